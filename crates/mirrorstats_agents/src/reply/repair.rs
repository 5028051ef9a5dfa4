//! Named repairs that a reply may get before it counts as unreadable. No repair changes a word: half of a split
//! surrogate pair is not one.
//!
//! Repairs apply in a fixed order, each on top of the previous ones, until the text is one JSON object: read a JSON
//! string; unwrap a code fence; drop the thoughts before the answer, and unwrap its code fence, string or list; extract
//! the single object from the text around it; drop comments; drop commas before closing brackets; turn single-quoted
//! strings into double-quoted ones;
//! escape control characters in strings; replace lone surrogates by U+FFFD. A function call is replaced by its
//! arguments, and a wrapper by the object in it.

use std::fmt::Write as _;

use super::object::Object;
use super::surrogates::without_lone_surrogates;
use super::thoughts::{self, Thoughts};
use mirrorstats_exact::names;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Repair {
    CodeFence,
    /// Thoughts, such as `<think>...</think>`, preceded the object.
    Thoughts,
    /// There was text before or after the object.
    SurroundingText,
    TrailingComma,
    SingleQuotes,
    /// A string had half of a pair of surrogates (`\ud83d` without `\ude00`), which is no character.
    Surrogate,
    /// Comments, `// ...` or `/* ... */`, occurred outside of strings.
    Comment,
    /// A string had a raw line feed, tab or another control character in it.
    ControlCharacter,
    /// The object came as the arguments of a function call, or in place of the message's text.
    ToolCall,
    /// The object was in a list of one, or the only member of another one.
    Wrapper,
    /// The JSON was a JSON string.
    JsonString,
    /// A key had other letter case or separators: `selected-cube`.
    KeySpelling,
    /// A value had other letter case, or white space or punctuation around it: `"DONE"`, `"RED."`.
    ValueSpelling,
    /// The action came in the prompt's words for it: `"turn right"`, `"d = turn right by 30 degrees"`.
    ActionWords,
}

names!(Repair {
    CodeFence: "code_fence",
    Thoughts: "thoughts",
    SurroundingText: "surrounding_text",
    TrailingComma: "trailing_comma",
    SingleQuotes: "single_quotes",
    Surrogate: "surrogate",
    Comment: "comment",
    ControlCharacter: "control_character",
    ToolCall: "tool_call",
    Wrapper: "wrapper",
    JsonString: "json_string",
    KeySpelling: "key_spelling",
    ValueSpelling: "value_spelling",
    ActionWords: "action_words",
});

impl Repair {
    /// The names of repairs as in the column `reply_repair`; `None` without repairs.
    ///
    /// ```
    /// use mirrorstats_agents::reply::Repair;
    ///
    /// let both = Repair::joined(&[Repair::CodeFence, Repair::TrailingComma]);
    /// assert_eq!(both.as_deref(), Some("code_fence+trailing_comma"));
    /// assert_eq!(Repair::joined(&[]), None);
    /// ```
    pub fn joined(repairs: &[Self]) -> Option<String> {
        let names: Vec<_> = repairs.iter().map(|repair| repair.name()).collect();
        (!names.is_empty()).then(|| names.join("+"))
    }
}

type TextRepair = fn(&str) -> Option<String>;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum NoObject {
    /// The strict parser's message about the original text, if it has a brace.
    Unreadable(String),
    /// The reply ends within its thoughts.
    OpenThoughts,
    ThoughtsAlone,
}

pub(super) fn object(raw: &str) -> Result<(Object, Vec<Repair>), NoObject> {
    let first = match Object::parse(raw.trim()) {
        Ok(object) => return Ok(unwrapped(object, raw, Vec::new())),
        Err(_) if !raw.contains('{') => {
            NoObject::Unreadable("expected a JSON object, found text without one".to_owned())
        }
        Err(fault) => NoObject::Unreadable(format!("expected a JSON object: {fault}")),
    };
    // A fence may be one of thoughts.
    has_answer(raw.trim())?;
    let mut text = raw.trim().to_owned();
    let mut repairs = Vec::new();
    let steps: [(Repair, TextRepair); 12] = [
        (Repair::JsonString, in_string),
        (Repair::CodeFence, without_fence),
        (Repair::Thoughts, without_thoughts),
        (Repair::CodeFence, without_fence),
        (Repair::JsonString, in_string),
        (Repair::Wrapper, without_list),
        (Repair::SurroundingText, without_surroundings),
        (Repair::Comment, without_comments),
        (Repair::TrailingComma, without_trailing_commas),
        (Repair::SingleQuotes, |text| with_strings(text, in_double_quotes)),
        (Repair::ControlCharacter, |text| with_strings(text, with_escaped_controls)),
        (Repair::Surrogate, without_lone_surrogates),
    ];
    for (repair, change) in steps {
        if repair == Repair::Thoughts {
            has_answer(&text)?;
        }
        let Some(changed) = change(&text) else { continue };
        text = changed;
        repairs.push(repair);
        if let Ok(object) = Object::parse(&text) {
            return Ok(unwrapped(object, &text, repairs));
        }
    }
    Err(first)
}

/// The arguments of a function call or the object in a wrapper, parsed again so that no repeated key is lost; any other
/// object unchanged.
fn unwrapped(object: Object, text: &str, mut repairs: Vec<Repair>) -> (Object, Vec<Repair>) {
    let inner = || {
        let opening = |piece| matches!(piece, JsonPiece::Mark(_, '{')).then_some(piece);
        let JsonPiece::Mark(at, _) = Pieces::new(text).filter_map(opening).nth(1)? else { return None };
        let length = end_of_object(&text[at..])?;
        Object::parse(&text[at..at + length]).ok()
    };
    let repair = if object.is_call() { Repair::ToolCall } else { Repair::Wrapper };
    match (object.is_call() || object.is_wrapper()).then(inner).flatten() {
        Some(inner) => {
            repairs.push(repair);
            (inner, repairs)
        }
        None => (object, repairs),
    }
}

/// Rejects a text of thoughts alone: an object within them is no answer.
fn has_answer(text: &str) -> Result<(), NoObject> {
    match thoughts::split(text) {
        Thoughts::Open => Err(NoObject::OpenThoughts),
        Thoughts::Before("") => Err(NoObject::ThoughtsAlone),
        Thoughts::Before(_) | Thoughts::None => Ok(()),
    }
}

/// The text of a JSON string with an object.
fn in_string(text: &str) -> Option<String> {
    let inside: String = serde_json::from_str(text).ok()?;
    inside.contains('{').then(|| inside.trim().to_owned())
}

/// The only element of a list, an object.
fn without_list(text: &str) -> Option<String> {
    let inside = text.strip_prefix('[')?.strip_suffix(']')?.trim();
    (inside.starts_with('{') && end_of_object(inside)? == inside.len()).then(|| inside.to_owned())
}

fn without_thoughts(text: &str) -> Option<String> {
    match thoughts::split(text) {
        Thoughts::Before(answer) => Some(answer.to_owned()),
        Thoughts::None | Thoughts::Open => None,
    }
}

fn without_fence(text: &str) -> Option<String> {
    let inside = text.strip_prefix("```")?.strip_suffix("```")?;
    let body = inside.trim_start_matches(|c: char| c.is_ascii_alphanumeric());
    (!body.contains("```")).then(|| body.trim().to_owned())
}

/// The only top-level object of a text with more around it; `None` for no or several objects, or no other text.
fn without_surroundings(text: &str) -> Option<String> {
    let mut objects = Vec::new();
    let mut at = 0;
    while let Some(start) = text[at..].find('{').map(|offset| at + offset) {
        let end = end_of_object(&text[start..]).map(|length| start + length)?;
        objects.push(&text[start..end]);
        at = end;
    }
    match objects[..] {
        [object] if object.len() < text.len() => Some(object.to_owned()),
        _ => None,
    }
}

fn end_of_object(text: &str) -> Option<usize> {
    let mut depth = 0_usize;
    let mut pieces = Pieces::new(text);
    while let Some(piece) = pieces.next_outside_comments() {
        match piece {
            JsonPiece::Mark(_, '{') => depth += 1,
            JsonPiece::Mark(at, '}') => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(at + 1);
                }
            }
            _ => {}
        }
    }
    None
}

fn without_trailing_commas(text: &str) -> Option<String> {
    let mut dropped = Vec::new();
    let mut comma = None;
    for piece in Pieces::new(text) {
        match piece {
            JsonPiece::Mark(at, ',') => comma = Some(at),
            JsonPiece::Mark(_, '}' | ']') => dropped.extend(comma.take()),
            JsonPiece::Mark(_, c) if c.is_whitespace() => {}
            _ => comma = None,
        }
    }
    if dropped.is_empty() {
        return None;
    }
    Some(text.char_indices().filter(|(at, _)| !dropped.contains(at)).map(|(_, c)| c).collect())
}

/// The text with its strings changed; `None` if none changes.
fn with_strings(text: &str, change: fn(&str) -> Option<String>) -> Option<String> {
    let (mut changed, mut is_changed) = (String::with_capacity(text.len()), false);
    for piece in Pieces::new(text) {
        match piece {
            JsonPiece::Mark(_, c) => changed.push(c),
            JsonPiece::Quoted(string) => {
                let other = change(string);
                is_changed |= other.is_some();
                changed.push_str(other.as_deref().unwrap_or(string));
            }
        }
    }
    is_changed.then_some(changed)
}

fn in_double_quotes(string: &str) -> Option<String> {
    let inside = string.strip_prefix('\'')?.strip_suffix('\'')?;
    let (mut text, mut characters) = ("\"".to_owned(), inside.chars());
    while let Some(c) = characters.next() {
        match c {
            '\\' => match characters.next() {
                Some('\'') => text.push('\''),
                escaped => text.extend(['\\'].into_iter().chain(escaped)),
            },
            '"' => text.push_str("\\\""),
            c => text.push(c),
        }
    }
    text.push('"');
    Some(text)
}

fn without_comments(text: &str) -> Option<String> {
    let (mut kept, mut pieces) = (String::with_capacity(text.len()), Pieces::new(text));
    while let Some(piece) = pieces.next_outside_comments() {
        match piece {
            JsonPiece::Mark(_, c) => kept.push(c),
            JsonPiece::Quoted(string) => kept.push_str(string),
        }
    }
    (kept.len() < text.len()).then_some(kept)
}

fn length_of_comment(text: &str) -> Option<usize> {
    if let Some(rest) = text.strip_prefix("//") {
        return Some(rest.find('\n').map_or(text.len(), |end| 2 + end));
    }
    let rest = text.strip_prefix("/*")?;
    Some(rest.find("*/").map_or(text.len(), |end| end + 4))
}

fn with_escaped_controls(string: &str) -> Option<String> {
    let (mut text, mut is_escaped) = (String::with_capacity(string.len()), false);
    for c in string.chars() {
        if c.is_ascii_control() && c != '\x7f' && !is_escaped {
            let _ = write!(text, "\\u{:04x}", u32::from(c));
        } else {
            text.push(c);
        }
        is_escaped = c == '\\' && !is_escaped;
    }
    (text.len() > string.len()).then_some(text)
}

/// A piece of almost-JSON: a string with its quotes, or one character outside of strings and its position.
enum JsonPiece<'a> {
    Quoted(&'a str),
    Mark(usize, char),
}

struct Pieces<'a> {
    text: &'a str,
    at: usize,
    before: char,
}

impl<'a> Pieces<'a> {
    fn new(text: &'a str) -> Self {
        Self { text, at: 0, before: ':' }
    }

    fn next_outside_comments(&mut self) -> Option<JsonPiece<'a>> {
        while let Some(length) = length_of_comment(&self.text[self.at..]) {
            self.at += length;
        }
        self.next()
    }

    fn length_of_string(rest: &str, quote: char) -> usize {
        let mut is_escaped = false;
        for (at, c) in rest.char_indices().skip(1) {
            match c {
                _ if is_escaped => is_escaped = false,
                '\\' => is_escaped = true,
                '"' if quote == '"' => return at + 1,
                // An apostrophe ends a string only where a string may end.
                '\'' if quote == '\'' && ends_a_string(&rest[at + 1..]) => return at + 1,
                _ => {}
            }
        }
        rest.len()
    }
}

fn ends_a_string(rest: &str) -> bool {
    rest.trim_start().chars().next().is_none_or(|c| matches!(c, ',' | ':' | '}' | ']'))
}

impl<'a> Iterator for Pieces<'a> {
    type Item = JsonPiece<'a>;

    fn next(&mut self) -> Option<JsonPiece<'a>> {
        let rest = &self.text[self.at..];
        let c = rest.chars().next()?;
        let at = self.at;
        let is_string = c == '"' || c == '\'' && matches!(self.before, '{' | '[' | ',' | ':');
        if is_string {
            let length = Self::length_of_string(rest, c);
            self.at += length;
            self.before = c;
            return Some(JsonPiece::Quoted(&rest[..length]));
        }
        self.at += c.len_utf8();
        if !c.is_whitespace() {
            self.before = c;
        }
        Some(JsonPiece::Mark(at, c))
    }
}
