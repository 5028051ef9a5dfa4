//! A reasoning model's thoughts before its answer, such as `<think>...</think>`.
//!
//! Servers that separate them send none. Others send them in the text, some without the opening mark, since it is the
//! end of their prompt.
//!
//! Rule: the content of thoughts is no answer, not even a whole object.

use std::sync::LazyLock;

use regex::Regex;

use super::object::Object;

/// A mark that no text has.
const NEVER: &str = r"[^\s\S]";

/// Each kind of thoughts: the opening mark; the closing mark, which counts without an opening one too; the mark that
/// closes opened thoughts if there is no other. Closing marks include the header of the answer.
const MARKS: [[&str; 3]; 10] = [
    // Qwen, DeepSeek, EXAONE and others; tags may have a prefix (`seed:think`, `longcat_think`), attributes, escapes.
    [
        r"(?:<|&lt;)\s*(?:[\w-]+[:_])?(?:think|thinking|thoughts?|reasoning|reflection|scratchpad|analysis)(?:_process)?(?:\s[^<>]*?)?(?:>|&gt;)",
        r"(?:<|&lt;)\s*/\s*(?:[\w-]+[:_])?(?:think|thinking|thoughts?|reasoning|reflection|scratchpad|analysis)(?:_process)?\s*(?:>|&gt;)",
        NEVER,
    ],
    // Open WebUI.
    [r#"<details\s[^<>]*\btype="reasoning"[^<>]*>"#, NEVER, r"</details\s*>"],
    // Granite.
    [r"here is my thought process:", NEVER, r"here is my response:"],
    // Mistral.
    [
        r"\[(?:think|thinking|thoughts?|reasoning|analysis)\]",
        r"\[/(?:think|thinking|thoughts?|reasoning|analysis)\]",
        NEVER,
    ],
    // Kimi.
    [r"\x{25c1}think(?:ing)?\x{25b7}", r"\x{25c1}/think(?:ing)?\x{25b7}", NEVER],
    // Harmony (gpt-oss), with every channel but the final one; Gemma 4, `<|channel>thought` to `<channel|>`.
    [
        r"<\|?channel\|?>\s*(?:analysis|commentary|thoughts?|think|thinking|reasoning)\b",
        r"<\|channel\|?>\s*final\b[^<{]*(?:<\|constrain\|>[^<{]*)?(?:<\|message\|>)?",
        r"<\|end\|>|<channel\|>",
    ],
    // Harmony without its special tokens: `analysisWe need ...assistantfinal{...}`.
    [r"^(?:assistant)?(?:analysis|commentary)(?-i:[A-Z{])", NEVER, r"assistant\s*final"],
    // OpenThinker, Command A, Apertus, Solar.
    [
        r"<\|(?:begin_of_thought|start_thinking|inner_prefix|think(?:ing)?)\|>",
        r"<\|(?:end_of_thought|end_thinking|inner_suffix|/think(?:ing)?)\|>\s*(?:<\|(?:begin_of_solution|start_response|start_text)\|>)?",
        r"<\|end\|>",
    ],
    // MedGemma.
    ["<unused94>", "<unused95>", NEVER],
    // A fenced block of thoughts ends with the first fence: the answer may have a fence of its own.
    [
        r"(?:```|~~~)\s*(?:think|thinking|thoughts?|reasoning|analysis|reflection|scratchpad)\b",
        NEVER,
        r"^[\s\S]*?(?:```|~~~)",
    ],
];

/// The mark of the answer's end in the formats that mark its beginning.
const END: &str = r"(?:<\|(?:return|end|end_of_solution|end_response|end_text)\|>|<turn\|>)$";

struct Kind {
    opening: Regex,
    closing: Regex,
    weak: Regex,
}

static KINDS: LazyLock<Vec<Kind>> = LazyLock::new(|| {
    let kinds = MARKS.map(|marks| marks.map(compiled));
    kinds.into_iter().map(|[opening, closing, weak]| Kind { opening, closing, weak }).collect()
});

static ENDS: LazyLock<Regex> = LazyLock::new(|| compiled(END));

fn compiled(mark: &str) -> Regex {
    Regex::new(&format!("(?i){mark}")).expect("the marks are patterns")
}

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
/// They end with the last closing mark of their kind, so thoughts may mention the mark. If only an object follows an
/// earlier one, they end there: later ones are in the answer's strings, as are opening marks after the first brace.
pub(super) fn split(text: &str) -> Thoughts<'_> {
    let (mut rest, mut found) = (text, Thoughts::None);
    loop {
        if found != Thoughts::None && Object::parse(rest).is_ok() {
            return found;
        }
        let end = match opened(rest) {
            Some((kind, after)) => match kind.end(&rest[after..]) {
                Some(end) => after + end,
                None => return Thoughts::Open,
            },
            None => match KINDS.iter().filter_map(|kind| last(&kind.closing, rest)).max() {
                Some(end) => end,
                None => return found,
            },
        };
        rest = without_end(&rest[end..]);
        found = Thoughts::Before(rest);
    }
}

/// Returns true if a text has an object outside of its thoughts.
#[cfg(feature = "play")]
pub fn has_object(text: &str) -> bool {
    match split(text) {
        Thoughts::None => text.contains('{'),
        Thoughts::Before(answer) => answer.contains('{'),
        Thoughts::Open => false,
    }
}

/// The kind of the first opening mark before the first brace, and the mark's end.
fn opened(text: &str) -> Option<(&'static Kind, usize)> {
    let brace = text.find('{').unwrap_or(text.len());
    let marks = KINDS.iter().filter_map(|kind| Some((kind.opening.find(text)?, kind)));
    let first = marks.filter(|(mark, _)| mark.start() < brace).min_by_key(|(mark, _)| mark.start());
    first.map(|(mark, kind)| (kind, mark.end()))
}

impl Kind {
    /// The end of opened thoughts.
    fn end(&self, text: &str) -> Option<usize> {
        let has_more = |end: &usize| !without_end(&text[*end..]).is_empty();
        let weak = || self.weak.find_iter(text).map(|mark| mark.end()).filter(has_more).last();
        last(&self.closing, text).or_else(weak).or_else(|| last(&self.weak, text))
    }
}

fn last(mark: &Regex, text: &str) -> Option<usize> {
    let is_object = |end: &usize| Object::parse(without_end(&text[*end..])).is_ok();
    let ends = || mark.find_iter(text).map(|mark| mark.end());
    ends().find(is_object).or_else(|| ends().last())
}

fn without_end(text: &str) -> &str {
    let text = text.trim();
    ENDS.find(text).map_or(text, |end| text[..end.start()].trim())
}

#[cfg(test)]
mod tests {
    use super::{Thoughts, split};

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
            ("{} <|end|>", Thoughts::None),
            ("```thinking\n{1}\n```\n{}", Thoughts::Before("{}")),
            ("```thinking\n{1}\n```\n```json\n{}\n```\nDone.", Thoughts::Before("```json\n{}\n```\nDone.")),
            ("``` reasoning\n{1}\n", Thoughts::Open),
            ("~~~thinking\n{1}\n~~~\n{}", Thoughts::Before("{}")),
            ("```thinking\n{1}\n```", Thoughts::Before("")),
            ("<longcat_think>{1}</longcat_think>{}", Thoughts::Before("{}")),
            ("< thought_process >{1}</ thought_process >{}", Thoughts::Before("{}")),
            ("&lt;think&gt;{1}&lt;/think&gt;{}", Thoughts::Before("{}")),
            ("<analysis>{1}</analysis>{}", Thoughts::Before("{}")),
            ("<details type=\"reasoning\" done=\"true\"><summary>s</summary>{1}</details>{}", Thoughts::Before("{}")),
            ("[REASONING]{1}[/REASONING]{}", Thoughts::Before("{}")),
            ("Here is my thought process: {1} Here is my response: {}", Thoughts::Before("{}")),
            (
                "<think>a</think>{\"b\": \"I closed </think> before\"}",
                Thoughts::Before("{\"b\": \"I closed </think> before\"}"),
            ),
            ("<think>a</think>{\"b\": 1}</think>{}", Thoughts::Before("{}")),
            ("```json\n{\"a\": \"```thinking\"}\n```", Thoughts::None),
            ("<think>a [THINK] {1}</think>{}", Thoughts::Before("{}")),
            ("<think>a</think>[THINK]{1}[/THINK]{}", Thoughts::Before("{}")),
            ("<|channel|>analysis<|message|>{1}<|end|>{}<|end|>", Thoughts::Before("{}")),
            (
                "<|channel|>analysis<|message|>{1}<|end|><|start|>assistant<|channel|>commentary<|message|>{2}",
                Thoughts::Open,
            ),
            (
                "{1}<|end|><|start|>assistant<|channel|>final <|constrain|>json<|message|>{}<|return|>",
                Thoughts::Before("{}"),
            ),
        ] {
            assert_eq!(split(text), expected, "{text}");
        }
    }
}
