//! Tables as GitHub Markdown: one heading and table per group, bold for best, inserted text for second best.

use std::fmt::Write as _;

use unicode_width::UnicodeWidthStr;

use super::{Align, Look, RowGroup, Table, TableCell};
use mirrorstats_exact::escape::visible;

impl Table {
    /// As GitHub's Markdown.
    pub fn markdown(&self) -> String {
        let mut text = format!("**{}.**", escape(&self.title));
        for sentence in &self.sentences {
            let _ = write!(text, " {}", escape(sentence));
        }
        text.push('\n');
        for group in &self.groups {
            push_group(&mut text, group, self);
        }
        text
    }
}

fn push_group(text: &mut String, group: &RowGroup, table: &Table) {
    if let Some(heading) = &group.heading {
        let _ = write!(text, "\n### {}\n", escape(heading));
    }
    let spelled = |cell: &TableCell| cell.marked_up(escape, ["**", "**"], ["<ins>", "</ins>"]);
    let mut lines: Vec<Vec<String>> = vec![table.columns.iter().map(|column| column.spelled(escape)).collect()];
    lines.extend(group.rows.iter().map(|row| row.iter().map(spelled).collect()));
    text.push('\n');
    if table.look == Look::Sheet { push_aligned(text, &lines, table) } else { push_lines(text, &lines) }
}

/// Cells are as wide as their text: the widest are too wide to align.
fn push_lines(text: &mut String, lines: &[Vec<String>]) {
    for (at, line) in lines.iter().enumerate() {
        let _ = writeln!(text, "| {} |", line.join(" | "));
        if at == 0 {
            let _ = writeln!(text, "|{}", "---|".repeat(line.len()));
        }
    }
}

fn push_aligned(text: &mut String, lines: &[Vec<String>], table: &Table) {
    let width = |at: usize| lines.iter().map(|line| line[at].width()).max().unwrap_or(0).max(3);
    let widths: Vec<usize> = (0..table.columns.len()).map(width).collect();
    let columns = || table.columns.iter().zip(&widths);
    for (at, line) in lines.iter().enumerate() {
        let cells = columns().zip(line).map(|((column, &width), cell)| {
            let room = " ".repeat(width.saturating_sub(cell.width()));
            if column.align == Align::Left { format!(" {cell}{room} |") } else { format!(" {room}{cell} |") }
        });
        let _ = writeln!(text, "|{}", cells.collect::<String>());
        if at == 0 {
            let rules = columns().map(|(column, width)| {
                let dashes = "-".repeat(width - 1);
                if column.align == Align::Left { format!(" :{dashes} |") } else { format!(" {dashes}: |") }
            });
            let _ = writeln!(text, "|{}", rules.collect::<String>());
        }
    }
}

/// Text escaped so that it has no markup, links, mentions or mathematics.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in visible(text).chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '@' => escaped.push_str("&#64;"),
            '$' => escaped.push_str("&#36;"),
            '\\' | '`' | '*' | '[' | ']' | '|' | '~' | '#' | '!' => escaped.extend(['\\', c]),
            // GitHub treats an underscore between letters as text, but one at the end of a word as emphasis.
            '_' => escaped.extend(['\\', '_']),
            other => escaped.push(other),
        }
    }
    escaped.replace("://", "&#58;//").replace("www.", "www&#46;")
}

#[cfg(test)]
mod tests {
    use super::escape;

    #[test]
    fn markup_in_names_is_escaped() {
        for (text, expected) in [
            ("GPT 5.1 (mini)", "GPT 5.1 (mini)"),
            ("a|b`c`", "a\\|b\\`c\\`"),
            ("<img src=x onerror=y>", "&lt;img src=x onerror=y&gt;"),
            ("[x](https://e.org) @team", "\\[x\\](https&#58;//e.org) &#64;team"),
            ("*_~$x$", "\\*\\_\\~&#36;x&#36;"),
            ("one\ntwo", "one\\\\u{a}two"),
        ] {
            assert_eq!(escape(text), expected);
        }
    }
}
