//! Tables as Markdown (GitHub's): a heading and a table a group, bold for best, inserted text for second best.

use std::fmt::Write as _;

use unicode_width::UnicodeWidthStr;

use super::marked_up;
use crate::table::{Cell, Column, Row, RowGroup, Table};
use exact::escape::visible;

/// The whole table with its caption above.
pub fn render(table: &Table) -> String {
    let mut text = format!("**{}.**", escape(&table.title));
    for sentence in table.sentences() {
        let _ = write!(text, " {}", escape(sentence));
    }
    text.push('\n');
    for group in &table.groups {
        push_group(&mut text, group, table);
    }
    text
}

fn push_group(text: &mut String, group: &RowGroup, table: &Table) {
    if let Some(heading) = &group.heading {
        let _ = write!(text, "\n### {}\n", escape(heading));
    }
    let mut lines = vec![header(table)];
    lines.extend(group.rows.iter().map(|row| cells(row, table)));
    let widths: Vec<usize> = (0..=table.columns.len())
        .map(|at| lines.iter().map(|line| line[at].width()).max().unwrap_or(0).max(3))
        .collect();
    text.push('\n');
    for (at, line) in lines.iter().enumerate() {
        push_line(text, line, &widths);
        if at == 0 {
            push_rule(text, &widths);
        }
    }
}

fn push_line(text: &mut String, cells: &[String], widths: &[usize]) {
    for (at, (cell, &width)) in cells.iter().zip(widths).enumerate() {
        let room = " ".repeat(width.saturating_sub(cell.width()));
        let _ = if at == 0 { write!(text, "| {cell}{room} |") } else { write!(text, " {room}{cell} |") };
    }
    text.push('\n');
}

fn push_rule(text: &mut String, widths: &[usize]) {
    for (at, width) in widths.iter().enumerate() {
        let dashes = "-".repeat(width - 1);
        let _ = if at == 0 { write!(text, "| :{dashes} |") } else { write!(text, " {dashes}: |") };
    }
    text.push('\n');
}

fn header(table: &Table) -> Vec<String> {
    let of_column = |column: &Column| match column.better.arrow() {
        Some(arrow) => format!("{} {arrow}", escape(&column.metric)),
        None => escape(&column.metric),
    };
    std::iter::once(escape(&table.row_heading)).chain(table.columns.iter().map(of_column)).collect()
}

fn cells(row: &Row, table: &Table) -> Vec<String> {
    std::iter::once(escape(&row.name)).chain(row.cells.iter().map(|cell| spell(cell, table))).collect()
}

/// Numbers need no escaping, only the style's word for undefined does.
fn spell(cell: &Cell, table: &Table) -> String {
    marked_up(cell, &escape(&table.undefined), ["**", "**"], ["<ins>", "</ins>"])
}

/// Text in which nothing is markup, a link, a mention or mathematics.
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
            // An underscore between letters is no emphasis to GitHub, but one at an end of a word is.
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
    fn no_name_is_markup() {
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
