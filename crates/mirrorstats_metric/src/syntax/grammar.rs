//! The tokens and grammar of SQL, read by `sqlparser`: limits, and faults at their places.
//!
//! Used for expressions of definitions and for whole queries.

use std::ops::Range;

use sqlparser::dialect::GenericDialect;
use sqlparser::parser::{Parser, ParserError};
use sqlparser::tokenizer::{Location, Span, Token, TokenWithSpan, Tokenizer};

/// Shorter texts, in bytes, cannot give a tree that is too deep for a thread.
const SHALLOW: usize = 1024;

/// The stack for the deepest possible tree, in bytes; only the used part takes memory.
const STACK: usize = 128 << 20;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyntaxFault {
    pub message: String,
    pub span: Range<usize>,
    pub help: Option<String>,
}

/// The kind of text and its limits. A chain of operators nests as deeply as it is long, and the parser drops its tree
/// by recursion.
#[derive(Clone, Copy, Debug)]
pub struct Grammar {
    pub noun: &'static str,
    pub one: &'static str,
    pub longest: usize,
    pub most_tokens: usize,
    /// The remedy for a text that is too long or too deep.
    pub help: Option<&'static str>,
}

impl Grammar {
    /// A parser for a text whose tokens `edit` may change.
    pub fn parser(
        self,
        text: &str,
        edit: impl FnOnce(Vec<TokenWithSpan>) -> Vec<TokenWithSpan>,
    ) -> Result<Parser<'static>, SyntaxFault> {
        let too_long = |amount: usize, unit: &str, most: usize| {
            let message = format!("{} of {amount} {unit} is too long: the most is {most}", self.one);
            Err(SyntaxFault { message, span: 0..text.len(), help: self.help.map(str::to_owned) })
        };
        if text.len() > self.longest {
            return too_long(text.len(), "bytes", self.longest);
        }
        let tokens =
            Tokenizer::new(&GenericDialect {}, text).tokenize_with_location().map_err(|error| SyntaxFault {
                message: format!("not {}: {}", self.one, lowercase_first(&error.message)),
                span: byte_of(text, error.location)..text.len(),
                help: None,
            })?;
        let count = tokens.iter().filter(|token| !matches!(token.token, Token::Whitespace(_))).count();
        if count > self.most_tokens {
            return too_long(count, "words and signs", self.most_tokens);
        }
        Ok(Parser::new(&GenericDialect {}).with_tokens_with_locations(edit(tokens)))
    }

    pub fn fault(self, text: &str, error: &ParserError) -> SyntaxFault {
        let (message, help) = match error {
            ParserError::ParserError(message) | ParserError::TokenizerError(message) => (message.clone(), None),
            ParserError::RecursionLimitExceeded => {
                (format!("the {} is nested too deeply", self.noun), self.help.map(str::to_owned))
            }
        };
        let (words, span) = match split_location(&message) {
            Some((words, location)) => {
                let start = byte_of(text, location);
                (words.to_owned(), start..end_of_word(text, start))
            }
            None => (message.clone(), 0..text.len()),
        };
        let words = words.replace("EOF", &format!("the end of the {}", self.noun));
        SyntaxFault { message: format!("not {}: {}", self.one, lowercase_first(&words)), span, help }
    }
}

/// Runs work on the parser's tree with a large enough stack. The tree of `a + b + c` is as deep as the chain is long,
/// and the parser walks it by recursion.
pub fn with_stack<T>(text: &str, work: impl FnOnce() -> T) -> T {
    if text.len() < SHALLOW { work() } else { stacker::grow(STACK, work) }
}

/// Splits `Expected: x, found: y at Line: 1, Column: 2` into the words and the location.
fn split_location(message: &str) -> Option<(&str, Location)> {
    let (words, place) = message.rsplit_once(" at Line: ")?;
    let (line, column) = place.split_once(", Column: ")?;
    Some((words, Location::new(line.parse().ok()?, column.parse().ok()?)))
}

fn lowercase_first(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or_else(String::new, |first| first.to_lowercase().chain(characters).collect())
}

fn end_of_word(text: &str, start: usize) -> usize {
    let rest = &text[start..];
    let word = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
    start + word.max(rest.chars().next().map_or(0, char::len_utf8))
}

/// The byte of a 1-based line and column (in characters); the end of the text if it is beyond that.
pub(super) fn byte_of(text: &str, location: Location) -> usize {
    if location.line == 0 {
        return text.len();
    }
    let mut lines = text.split_inclusive('\n');
    let mut start = 0;
    for _ in 1..location.line {
        start += lines.next().map_or(0, str::len);
    }
    let line = lines.next().unwrap_or("");
    let column = usize::try_from(location.column.saturating_sub(1)).unwrap_or(usize::MAX);
    start + line.char_indices().nth(column).map_or(line.len(), |(at, _)| at)
}

/// The bytes of a span; all of them if the parser does not know it.
pub fn bytes_of(text: &str, span: Span) -> Range<usize> {
    if span.start.line == 0 {
        return 0..text.len();
    }
    let start = byte_of(text, span.start);
    start..byte_of(text, span.end).max(start)
}

/// The start of a text that may be as long as an expression.
pub fn shortened(text: &str) -> String {
    const ENOUGH: usize = 60;
    match text.char_indices().nth(ENOUGH) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
