//! Makes visible the characters that act or hide instead of showing themselves.
//!
//! Rule: every name that the program did not choose passes through [`visible`] on its way to a person: terminal,
//! messages, Markdown, LaTeX, HTML, figures. Names in files for programs (CSV, JSON, Parquet) stay unchanged.

use std::sync::LazyLock;

use regex::{Captures, Regex};

/// Sequences that need an invisible character, then single characters that act or hide. The first group is kept: emoji
/// with variation selectors and joiners, keycaps, and the joiners between letters of the scripts whose spelling uses
/// them. Everywhere else these characters make different names look the same.
static ACTS_OR_HIDES: LazyLock<Regex> = LazyLock::new(|| {
    let pattern = r"(?x)
        ( \p{Extended_Pictographic} [\x{FE0E}\x{FE0F}]? \p{Emoji_Modifier}?
          (?: \x{200D} \p{Extended_Pictographic} [\x{FE0E}\x{FE0F}]? \p{Emoji_Modifier}? )*
        | [0-9\#*] \x{FE0F} \x{20E3}
        | JOINED (?: [\x{200C}\x{200D}] JOINED )+
        )
        | [\p{Other} \p{Line_Separator} \p{Paragraph_Separator} \p{Default_Ignorable_Code_Point}]";
    let joined = r"[[\p{Arabic}\p{Syriac}\p{Devanagari}\p{Bengali}\p{Gurmukhi}\p{Gujarati}\p{Oriya}\p{Tamil}\p{Telugu}
        \p{Kannada}\p{Malayalam}\p{Sinhala}\p{Khmer}\p{Myanmar}\p{Mongolian}]&&[\p{Letter}\p{Mark}]]";
    Regex::new(&pattern.replace("JOINED", joined)).expect("the pattern is a constant")
});

/// `text` with every character that acts or hides spelled as `\u{1b}`.
///
/// These are Unicode's categories Other (controls, bidirectional and other format characters, tags, private use,
/// unassigned), Line and Paragraph Separator, and all other characters that fonts leave out by default (fillers,
/// variation selectors). Emoji sequences and the joiners that some scripts need stay. Lines become one line.
pub fn visible(text: &str) -> String {
    if text.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic()) {
        return text.to_owned();
    }
    let spelled = |found: &Captures<'_>| match found.get(1) {
        Some(kept) => kept.as_str().to_owned(),
        None => found[0].escape_unicode().to_string(),
    };
    ACTS_OR_HIDES.replace_all(text, spelled).into_owned()
}

/// Like [`visible`], but also spells all white space except the ordinary space: for values whose white space is the
/// fault.
pub fn exact(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in visible(text).chars() {
        if c != ' ' && c.is_whitespace() { shown.extend(c.escape_unicode()) } else { shown.push(c) }
    }
    shown
}

/// Applies [`visible`] to each line of `text`; for texts whose line breaks are the program's own.
pub fn visible_lines(text: &str) -> String {
    text.lines().map(visible).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::{visible, visible_lines};

    #[test]
    fn active_characters_are_escaped_and_letters_are_kept() {
        for (text, expected) in [
            ("Gemma4 26B", "Gemma4 26B"),
            ("\x1b[31mred", "\\u{1b}[31mred"),
            ("a\nb\tc\r", "a\\u{a}b\\u{9}c\\u{d}"),
            ("abc\u{202e}fed", "abc\\u{202e}fed"),
            ("é–日本", "é–日本"),
            ("", ""),
        ] {
            assert_eq!(visible(text), expected);
        }
    }

    #[test]
    fn active_and_hidden_characters_are_spelled_out() {
        let hidden = "\u{0}\u{1b}\u{7f}\u{85}\u{ad}\u{34f}\u{61c}\u{115f}\u{17b4}\u{180b}\u{180e}\u{200b}\u{200c}\u{200d}\u{200e}\
            \u{200f}\u{2028}\u{2029}\u{202a}\u{202e}\u{2060}\u{2065}\u{2066}\u{2069}\u{206a}\u{3164}\u{e000}\u{fdd0}\u{fe00}\
            \u{fe0f}\u{feff}\u{ffa0}\u{fff9}\u{fffb}\u{ffff}\u{1d173}\u{e0001}\u{e0020}\u{e007f}\u{e0100}\u{e01ef}\u{f0000}\
            \u{10ffff}";
        for c in hidden.chars() {
            let code = format!("\\u{{{:x}}}", u32::from(c));
            assert_eq!(visible(&format!("a{c}b")), format!("a{code}b"));
            assert_eq!(visible(&format!("{c}")), code);
        }
    }

    #[test]
    fn ordinary_text_of_any_script_and_emoji_stay() {
        for text in [
            "Ωμέγα Ж é e\u{301} ñ",
            "日本語モデル 中文 한국어",
            "עברית العربية",
            "می\u{200c}خواهم",
            "क\u{94d}\u{200d}ष শ্\u{200c}য",
            "ไทย ខ្មែរ မြန်မာ",
            "🤖 ❤\u{fe0f} ⚠\u{fe0f}",
            "👩\u{200d}🔬 👩🏽\u{200d}🚀 🏳\u{fe0f}\u{200d}🌈 👨\u{200d}👩\u{200d}👧",
            "🇩🇪 1\u{fe0f}\u{20e3}",
            "a\u{a0}b\u{3000}c × ± † ✓ ∑",
        ] {
            assert_eq!(visible(text), text);
        }
    }

    #[test]
    fn a_joiner_that_joins_nothing_is_escaped() {
        for (text, expected) in [
            ("x\u{200d}y", "x\\u{200d}y"),
            ("🤖\u{200d}", "🤖\\u{200d}"),
            ("🤖\u{200d}x", "🤖\\u{200d}x"),
            ("م\u{200c}", "م\\u{200c}"),
            ("م\u{200c}\u{200c}م", "م\\u{200c}\\u{200c}م"),
            ("a\u{fe0f}", "a\\u{fe0f}"),
            ("1\u{fe0f}", "1\\u{fe0f}"),
            ("🏴\u{e0067}\u{e007f}", "🏴\\u{e0067}\\u{e007f}"),
        ] {
            assert_eq!(visible(text), expected);
        }
    }

    #[test]
    fn the_lines_of_a_message_stay_lines() {
        assert_eq!(visible_lines("a\u{2028}b\nc\u{1b}\n"), "a\\u{2028}b\nc\\u{1b}");
    }
}
