//! Translates a regular expression of the `regex` crate to `java.util.regex`, which Spark uses.
//!
//! The two syntaxes share most characters, but some have different meanings (`$`, `.`, `\b`, `\v`, `(?i)`,
//! `[[:alpha:]]`, `a++`). So the whole pattern is rewritten from its meaning, with character classes and letter case
//! spelled out. Only the existence of a match is kept, not its position or groups.
//!
//! A word character stays `\w`, in the Unicode version of the running Java.

use std::fmt::Write as _;

use regex_syntax::hir::{Class, ClassUnicode, ClassUnicodeRange, Hir, HirKind, Look, Repetition};

const UNICODE_WORD: &str = r"(?U:\w)";
const ASCII_WORD: &str = "[0-9A-Z_a-z]";

/// The pattern for Java; `None` if the `regex` crate refuses it.
pub(super) fn java(pattern: &str) -> Option<String> {
    let meaning = regex_syntax::parse(pattern).ok()?;
    let mut text = String::new();
    write(&meaning, &mut text);
    Some(text)
}

fn write(hir: &Hir, text: &mut String) {
    match hir.kind() {
        HirKind::Empty => {}
        HirKind::Literal(literal) => String::from_utf8_lossy(&literal.0).chars().for_each(|c| character(c, text)),
        HirKind::Class(Class::Unicode(class)) => class_of(class, text),
        // Only ASCII remains if Unicode is off and the text must stay valid.
        HirKind::Class(Class::Bytes(class)) => {
            class_of(&class.to_unicode_class().unwrap_or_else(ClassUnicode::empty), text);
        }
        HirKind::Look(look) => text.push_str(&place(*look)),
        HirKind::Repetition(repetition) => repeated(repetition, text),
        HirKind::Capture(capture) => group(&capture.sub, text),
        HirKind::Concat(parts) => parts.iter().for_each(|part| write(part, text)),
        HirKind::Alternation(choices) => {
            for (at, choice) in choices.iter().enumerate() {
                text.push_str(if at == 0 { "(?:" } else { "|" });
                write(choice, text);
            }
            text.push(')');
        }
    }
}

fn group(hir: &Hir, text: &mut String) {
    text.push_str("(?:");
    write(hir, text);
    text.push(')');
}

fn repeated(repetition: &Repetition, text: &mut String) {
    group(&repetition.sub, text);
    match (repetition.min, repetition.max) {
        (0, None) => text.push('*'),
        (1, None) => text.push('+'),
        (0, Some(1)) => text.push('?'),
        (min, None) => drop(write!(text, "{{{min},}}")),
        (min, Some(max)) => drop(write!(text, "{{{min},{max}}}")),
    }
    if !repetition.greedy {
        text.push('?');
    }
}

fn character(c: char, text: &mut String) {
    match c {
        _ if c.is_ascii_alphanumeric() || c == ' ' || c == '_' => text.push(c),
        _ if c.is_ascii_graphic() => text.extend(['\\', c]),
        _ => drop(write!(text, "\\x{{{:X}}}", u32::from(c))),
    }
}

fn class_of(class: &ClassUnicode, text: &mut String) {
    let mut others = class.clone();
    others.negate();
    match () {
        () if is_word(class) => text.push_str(UNICODE_WORD),
        () if is_word(&others) => text.push_str(r"(?U:\W)"),
        () if class.ranges().len() <= others.ranges().len() && !class.ranges().is_empty() => {
            ranges("[", class.ranges(), text);
        }
        () if others.ranges().is_empty() => text.push_str(r"[\x{0}-\x{10FFFF}]"),
        () => ranges("[^", others.ranges(), text),
    }
}

fn is_word(class: &ClassUnicode) -> bool {
    let word = regex_syntax::parse(r"\w");
    word.is_ok_and(|word| matches!(word.kind(), HirKind::Class(Class::Unicode(word)) if word == class))
}

fn ranges(open: &str, ranges: &[ClassUnicodeRange], text: &mut String) {
    text.push_str(open);
    for range in ranges {
        character(range.start(), text);
        if range.end() != range.start() {
            text.push('-');
            character(range.end(), text);
        }
    }
    text.push(']');
}

fn place(look: Look) -> String {
    let edge = |word: &str| format!("(?:(?<={word})(?!{word})|(?<!{word})(?={word}))");
    let inside = |word: &str| format!("(?:(?<={word})(?={word})|(?<!{word})(?!{word}))");
    let start = |word: &str| format!("(?<!{word})(?={word})");
    let end = |word: &str| format!("(?<={word})(?!{word})");
    match look {
        Look::Start => r"\A".to_owned(),
        Look::End => r"\z".to_owned(),
        Look::StartLF => r"(?<![^\x{A}])".to_owned(),
        Look::EndLF => r"(?![^\x{A}])".to_owned(),
        Look::StartCRLF => r"(?:\A|(?<=\x{A})|(?<=\x{D})(?!\x{A}))".to_owned(),
        Look::EndCRLF => r"(?:\z|(?=\x{D})|(?<!\x{D})(?=\x{A}))".to_owned(),
        Look::WordUnicode => edge(UNICODE_WORD),
        Look::WordAscii => edge(ASCII_WORD),
        Look::WordUnicodeNegate => inside(UNICODE_WORD),
        Look::WordAsciiNegate => inside(ASCII_WORD),
        Look::WordStartUnicode => start(UNICODE_WORD),
        Look::WordStartAscii => start(ASCII_WORD),
        Look::WordEndUnicode => end(UNICODE_WORD),
        Look::WordEndAscii => end(ASCII_WORD),
        Look::WordStartHalfUnicode => format!("(?<!{UNICODE_WORD})"),
        Look::WordStartHalfAscii => format!("(?<!{ASCII_WORD})"),
        Look::WordEndHalfUnicode => format!("(?!{UNICODE_WORD})"),
        Look::WordEndHalfAscii => format!("(?!{ASCII_WORD})"),
    }
}

#[cfg(test)]
mod tests {
    use super::java;

    #[test]
    fn patterns_with_two_meanings_are_rewritten() {
        for (pattern, expected) in [
            ("d.n[e]$", r"d[^\x{A}]ne\z"),
            ("(?i)maybe|so", r"(?:[Mm][Aa][Yy][Bb][Ee]|[Ss\x{17F}][Oo])"),
            ("^a++b", r"\A(?:(?:a)+)+b"),
            ("[[:alpha:]]", "[A-Za-z]"),
            (r"\v\.'", r"\x{B}\.\'"),
            (r"(?s:.)x{2,3}?", r"[\x{0}-\x{10FFFF}](?:x){2,3}?"),
            (r"(?m)^é$", r"(?<![^\x{A}])\x{E9}(?![^\x{A}])"),
            (r"\w\W", r"(?U:\w)(?U:\W)"),
            (r"(?-u:\b)a", r"(?:(?<=[0-9A-Z_a-z])(?![0-9A-Z_a-z])|(?<![0-9A-Z_a-z])(?=[0-9A-Z_a-z]))a"),
            ("", ""),
        ] {
            assert_eq!(java(pattern).as_deref(), Some(expected), "{pattern}");
        }
        assert_eq!(java("("), None);
    }
}
