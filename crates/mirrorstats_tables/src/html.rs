//! Tables as HTML, for notebooks: one table, one line per group, bold for best, underlined for second best.
//!
//! Rule: it has no script, no style sheet and no name that could collide with the surrounding page.

use std::fmt::Write as _;

use super::Table;
use mirrorstats_exact::escape::visible;

const NUMBER: &str = " style=\"text-align: right; white-space: nowrap\"";
const NAME: &str = " style=\"text-align: left\"";

impl Table {
    /// As HTML for notebooks.
    pub fn html(&self) -> String {
        let mut text = format!("<table>\n<caption{NAME}><b>{}.</b>", escape(&self.title));
        for sentence in &self.sentences {
            let _ = write!(text, " {}", escape(sentence));
        }
        text.push_str("</caption>\n<thead>\n");
        push_row(&mut text, "th", self, self.columns.iter().map(|column| column.spelled(escape)));
        text.push_str("</thead>\n");
        for group in &self.groups {
            text.push_str("<tbody>\n");
            if let Some(heading) = &group.heading {
                let columns = self.columns.len();
                let _ = writeln!(text, "<tr><th{NAME} colspan=\"{columns}\">{}</th></tr>", escape(heading));
            }
            for row in &group.rows {
                let cells = row.iter().map(|cell| cell.marked_up(escape, ["<b>", "</b>"], ["<u>", "</u>"]));
                push_row(&mut text, "td", self, cells);
            }
            text.push_str("</tbody>\n");
        }
        text.push_str("</table>\n");
        text
    }
}

fn push_row(text: &mut String, element: &str, table: &Table, cells: impl Iterator<Item = String>) {
    text.push_str("<tr>");
    for (cell, column) in cells.zip(&table.columns) {
        let style = if column.align == super::Align::Left { NAME } else { NUMBER };
        let _ = write!(text, "<{element}{style}>{cell}</{element}>");
    }
    text.push_str("</tr>\n");
}

fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in visible(text).chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '$' => escaped.push_str("&#36;"),
            '\\' => escaped.push_str("&#92;"),
            other => escaped.push(other),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::escape;
    use crate::{Column, RowGroup, Table};

    #[test]
    fn markup_in_names_is_escaped() {
        for (text, expected) in [
            ("GPT 5.1 (mini)", "GPT 5.1 (mini)"),
            ("<img src=x onerror=y>", "&lt;img src=x onerror=y&gt;"),
            ("\"a\" & 'b'", "&quot;a&quot; &amp; &#39;b&#39;"),
            ("$x$ \\(y\\)", "&#36;x&#36; &#92;(y&#92;)"),
            ("a\u{202e}b", "a&#92;u{202e}b"),
        ] {
            assert_eq!(escape(text), expected);
        }
    }

    #[test]
    fn every_text_of_a_table_is_escaped() {
        let text = || "<b>".to_owned();
        let table = Table {
            title: text(),
            sentences: vec![text(), text()],
            columns: vec![Column::left(text()), Column::right(text())],
            groups: vec![RowGroup { heading: Some(text()), rows: vec![vec![text().into()]] }],
            ..Table::default()
        };
        let html = table.html();
        // The one `<b>` that is markup encloses the title.
        assert_eq!((html.matches("<b>").count(), html.matches("&lt;b&gt;").count()), (1, 7), "{html}");
    }
}
