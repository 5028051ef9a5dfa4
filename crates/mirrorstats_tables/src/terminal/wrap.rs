//! Sentences and names in lines of a given width.

use unicode_width::{UnicodeWidthChar, UnicodeWidthStr};

/// Adds `text` in lines of at most `width` columns; `None` sets no limit. Later lines are indented by `indent` spaces.
pub fn push_wrapped(text: &mut String, words: &str, width: Option<usize>, indent: usize) {
    for line in wrapped(words, width.unwrap_or(usize::MAX), indent) {
        text.push_str(&line);
        text.push('\n');
    }
}

/// `text` in lines of at most `width` columns, if its words allow; later lines are indented by `indent` spaces.
pub fn wrapped(text: &str, width: usize, indent: usize) -> Vec<String> {
    let words = text.trim_start_matches(' ');
    let mut lines = vec![" ".repeat(text.len() - words.len())];
    // The width of the last line, and whether it has a word.
    let (mut taken, mut begun) = (text.len() - words.len(), false);
    for word in words.split(' ') {
        let columns = word.width();
        match lines.last_mut() {
            Some(line) if !begun => {
                line.push_str(word);
                taken += columns;
                begun = !word.is_empty();
            }
            Some(line) if taken + 1 + columns <= width => {
                line.push(' ');
                line.push_str(word);
                taken += 1 + columns;
            }
            _ => {
                lines.push(" ".repeat(indent) + word);
                taken = indent + columns;
                begun = !word.is_empty();
            }
        }
    }
    lines
}

/// `text` in lines of at most `width` columns; wider words are broken anywhere.
pub fn broken(text: &str, width: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for line in wrapped(text, width, 0) {
        let mut part = String::new();
        for c in line.chars() {
            if part.width() + c.width().unwrap_or(0) > width {
                lines.push(std::mem::take(&mut part));
            }
            part.push(c);
        }
        lines.push(part);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::{broken, wrapped};

    #[test]
    fn sentences_and_names_are_broken_into_lines() {
        assert_eq!(wrapped("- one two three", 9, 2), ["- one two", "  three"]);
        assert_eq!(wrapped("", 9, 2), [""]);
        assert_eq!(wrapped("  - a  b", usize::MAX, 4), ["  - a  b"]);
        assert_eq!(broken("one twothreefour", 6), ["one", "twothr", "eefour"]);
        assert_eq!(broken("日本語の名前", 5), ["日本", "語の", "名前"]);
    }
}
