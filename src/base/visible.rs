//! Characters that act instead of showing themselves, made visible.

/// `text` with control characters, line breaks and marks that reorder or hide text spelled as `\u{1b}`.
pub fn visible(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if acts(c) { shown.extend(c.escape_unicode()) } else { shown.push(c) }
    }
    shown
}

/// Whether a character acts: control characters, zero-width and bidirectional marks, line and paragraph separators, the
/// byte order mark.
pub fn acts(c: char) -> bool {
    let is_mark = matches!(c, '\u{ad}' | '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}');
    c.is_control() || is_mark || matches!(c, '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{e0000}'..='\u{e007f}')
}

#[cfg(test)]
mod tests {
    use super::visible;

    #[test]
    fn nothing_acts_and_letters_stay() {
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
}
