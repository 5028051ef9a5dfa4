//! A reasoning model's thoughts before its answer, `<think>...</think>`.
//!
//! Servers that separate them send none. Others send them in the text, some without the opening tag, since it is the
//! end of their prompt.
//!
//! Rule: the content of thoughts is no answer, not even a whole object.

const OPENING: &str = "<think>";
const CLOSING: &str = "</think>";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Thoughts<'a> {
    None,
    /// They end; the text after them, trimmed.
    Before(&'a str),
    /// They do not end: the reply was cut off.
    Open,
}

/// Removes the thoughts from a text.
///
/// They end with the last closing tag, so thoughts may mention the tag. An opening tag counts only before the first
/// brace: later ones may be in the answer's strings.
pub(super) fn of(text: &str) -> Thoughts<'_> {
    let after = text.rfind(CLOSING).map(|at| text[at + CLOSING.len()..].trim());
    let rest = after.unwrap_or(text);
    let before_brace = rest.split('{').next().unwrap_or_default();
    match after {
        _ if before_brace.contains(OPENING) => Thoughts::Open,
        Some(answer) => Thoughts::Before(answer),
        None => Thoughts::None,
    }
}

#[cfg(test)]
mod tests {
    use super::{Thoughts, of};

    #[test]
    fn thoughts_end_with_the_last_closing_tag() {
        for (text, expected) in [
            ("{\"a\": 1}", Thoughts::None),
            ("", Thoughts::None),
            ("<think>hm</think> {} ", Thoughts::Before("{}")),
            ("hm</think>{}", Thoughts::Before("{}")),
            ("<think>a</think><think>b</think>{}", Thoughts::Before("{}")),
            ("<think>I end with </think> and {1}</think>{2}", Thoughts::Before("{2}")),
            ("Sure. <think>hm</think>{}", Thoughts::Before("{}")),
            ("<think></think>", Thoughts::Before("")),
            ("<think>hm {}", Thoughts::Open),
            ("Well, <think>{}", Thoughts::Open),
            ("<think>a</think><think>b {}", Thoughts::Open),
            ("{\"a\": \"<think>\"}", Thoughts::None),
            ("<think>hm</think>{\"a\": \"<think>\"}", Thoughts::Before("{\"a\": \"<think>\"}")),
        ] {
            assert_eq!(of(text), expected, "{text}");
        }
    }
}
