//! Maps places in an expression to places in the file that contains it.
//!
//! An expression is the value of a TOML string. Escapes and line breaks make its text differ from the file's bytes, so
//! each byte of the text remembers its origin.

use std::ops::Range;
use std::sync::Arc;

use crate::fault::{Place, Source};

/// An expression's text and the source location of each of its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    pub text: String,
    source: Arc<Source>,
    /// `starts[i]` is the source byte of byte i of the text; one more entry marks the end.
    starts: Vec<usize>,
}

impl Written {
    /// A text that is its own source, such as an argument of the command line.
    pub fn whole(source: Arc<Source>) -> Self {
        let text = source.text.clone();
        Self { starts: (0..=text.len()).collect(), text, source }
    }

    /// A TOML string of a source: its decoded text, and the bytes of the literal, quotes included.
    pub(crate) fn toml_string(source: Arc<Source>, text: &str, literal: Range<usize>) -> Self {
        let starts = source.text.get(literal.clone()).and_then(|raw| string_starts(raw, text)).map_or_else(
            || vec![literal.start; text.len() + 1],
            |starts| starts.into_iter().map(|at| literal.start + at).collect(),
        );
        Self { text: text.to_owned(), source, starts }
    }

    /// The location of some bytes of the text.
    pub fn place(&self, span: Range<usize>) -> Place {
        let last = self.text.len();
        let start = self.starts[span.start.min(last)];
        let end = self.starts[span.end.min(last)];
        Place { source: self.source.clone(), span: start..end.max(start) }
    }

    pub fn everywhere(&self) -> Place {
        self.place(0..self.text.len())
    }
}

fn string_starts(raw: &str, text: &str) -> Option<Vec<usize>> {
    let (open, escapes) = opening(raw)?;
    let mut starts = Vec::with_capacity(text.len() + 1);
    let mut at = open;
    for decoded in text.chars() {
        if escapes {
            at = skip_line_continuations(raw, at);
        }
        starts.extend(std::iter::repeat_n(at, decoded.len_utf8()));
        at += spelling(&raw[at..], decoded, escapes)?;
    }
    starts.push(at);
    Some(starts)
}

/// The length of the opening quotes (and the line break that TOML drops after them), and whether escapes apply.
fn opening(raw: &str) -> Option<(usize, bool)> {
    let quote = raw.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    let triple = raw.starts_with(&quote.to_string().repeat(3)) && raw.len() >= 6;
    let quotes = if triple { 3 } else { 1 };
    let rest = &raw[quotes..];
    let line_break = ["\r\n", "\n"].into_iter().find(|line_break| triple && rest.starts_with(line_break));
    Some((quotes + line_break.map_or(0, str::len), quote == '"'))
}

fn spelling(rest: &str, decoded: char, escapes: bool) -> Option<usize> {
    let first = rest.chars().next()?;
    if decoded == '\n' && rest.starts_with("\r\n") {
        return Some(2);
    }
    if !(escapes && first == '\\') {
        return Some(first.len_utf8());
    }
    let digits = match rest.as_bytes().get(1)? {
        b'x' => 2,
        b'u' => 4,
        b'U' => 8,
        _ => 0,
    };
    Some(2 + digits)
}

fn skip_line_continuations(raw: &str, mut at: usize) -> usize {
    loop {
        let rest = &raw[at..];
        let Some(after) = rest.strip_prefix('\\') else { return at };
        if !after.trim_start_matches([' ', '\t', '\r']).starts_with('\n') {
            return at;
        }
        at = raw.len() - after.trim_start().len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The part of the file that spells the part `wanted` of the decoded text.
    fn spelled(file: &str, wanted: &str) -> String {
        let source = Arc::new(Source { name: "f".into(), text: file.into() });
        let table = toml::de::DeTable::parse(file).unwrap();
        let value = &table.get_ref()["x"];
        let text = value.get_ref().as_str().unwrap();
        let written = Written::toml_string(source, text, value.span());
        let start = text.find(wanted).unwrap();
        let place = written.place(start..start + wanted.len());
        file[place.span].to_owned()
    }

    #[test]
    fn spans_survive_every_kind_of_toml_string() {
        for (file, wanted, expected) in [
            ("x = \"a + bc\"", "bc", "bc"),
            ("x = 'a + bc'", "bc", "bc"),
            ("x = \"\"\"\na + bc\n\"\"\"", "bc", "bc"),
            ("x = '''\r\na\r\n+ bc'''", "bc", "bc"),
            (r#"x = "\"a\" + bc""#, "bc", "bc"),
            (r#"x = "\u00e9 + bc""#, "é + bc", r"\u00e9 + bc"),
            ("x = \"é + bc\"", "bc", "bc"),
            ("x = \"\"\"a \\\n   + bc\"\"\"", "bc", "bc"),
        ] {
            assert_eq!(spelled(file, wanted), expected, "{file}");
        }
    }
}
