//! Tables as HTML, for notebooks: one table, a line per group, bold for best, underlined for second best.
//!
//! Rule: it brings no script, no style sheet and no name that the page around it could have too.

use std::fmt::Write as _;

use super::marked_up;
use crate::table::{Cell, Column, Row, Table};
use exact::escape::visible;

const NUMBER: &str = " style=\"text-align: right; white-space: nowrap\"";
const NAME: &str = " style=\"text-align: left\"";

/// The table with its caption.
pub fn render(table: &Table) -> String {
    let mut text = format!("<table>\n<caption{NAME}><b>{}.</b>", escape(&table.title));
    for sentence in table.sentences() {
        let _ = write!(text, " {}", escape(sentence));
    }
    let _ = write!(text, "</caption>\n<thead>\n<tr><th{NAME}>{}</th>", escape(&table.row_heading));
    for column in &table.columns {
        let _ = write!(text, "<th{NUMBER}>{}</th>", heading(column));
    }
    text.push_str("</tr>\n</thead>\n");
    for group in &table.groups {
        text.push_str("<tbody>\n");
        if let Some(heading) = &group.heading {
            let columns = table.columns.len() + 1;
            let _ = writeln!(text, "<tr><th{NAME} colspan=\"{columns}\">{}</th></tr>", escape(heading));
        }
        group.rows.iter().for_each(|row| push_row(&mut text, row, table));
        text.push_str("</tbody>\n");
    }
    text.push_str("</table>\n");
    text
}

fn heading(column: &Column) -> String {
    let name = escape(&column.metric);
    column.better.arrow().map_or_else(|| name.clone(), |arrow| format!("{name} {arrow}"))
}

fn push_row(text: &mut String, row: &Row, table: &Table) {
    let _ = write!(text, "<tr><td{NAME}>{}</td>", escape(&row.name));
    for cell in &row.cells {
        let _ = write!(text, "<td{NUMBER}>{}</td>", spell(cell, table));
    }
    text.push_str("</tr>\n");
}

/// Numbers need no escaping, only the style's word for undefined does.
fn spell(cell: &Cell, table: &Table) -> String {
    marked_up(cell, &escape(&table.undefined), ["<b>", "</b>"], ["<u>", "</u>"])
}

/// Text in which nothing is markup, nor mathematics to a notebook.
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
    use super::{escape, render};
    use crate::cells::KeyValue;
    use crate::style::CellForm;
    use crate::table::{Column, Row, RowGroup, Table};
    use metric::catalog::Better;

    #[test]
    fn no_name_is_markup() {
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
            name: text(),
            title: text(),
            note: text(),
            footnotes: vec![text()],
            label: None,
            undefined: text(),
            form: CellForm::MeanSe,
            keys: vec!["model".to_owned()],
            row_heading: text(),
            columns: vec![Column { metric: text(), latex: None, better: Better::Higher }],
            groups: vec![RowGroup {
                heading: Some(text()),
                rows: vec![Row { key: vec![KeyValue::Missing], name: text(), cells: Vec::new() }],
            }],
        };
        let html = render(&table);
        // The one that is markup stands around the title.
        assert_eq!((html.matches("<b>").count(), html.matches("&lt;b&gt;").count()), (1, 7), "{html}");
    }
}
