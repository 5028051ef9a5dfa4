//! Tables as LaTeX: booktabs, set as the paper sets them.
//!
//! Needs the packages booktabs, graphicx and xcolor with its option `table`.

use std::fmt::Write as _;

use crate::table::{Cell, Column, DAGGER, Emphasis, Row, RowGroup, Table, Value};
use exact::escape::visible;
use metric::catalog::Better;

/// What has to stand in the preamble, as a comment before the table.
const PACKAGES: &str =
    "% Needs in the preamble: \\usepackage{booktabs}, \\usepackage{graphicx}, \\usepackage[table]{xcolor}\n";

/// The whole float, caption and label included.
pub fn render(table: &Table) -> String {
    let columns = "c".repeat(table.columns.len());
    let mut text = format!(
        "{PACKAGES}\\begin{{table*}}[t]\n\\centering\n\\resizebox{{\\textwidth}}{{!}}{{%\n\\begin{{tabular}}{{l{columns}}}\n\\toprule\n{}\n",
        header(table)
    );
    for (at, group) in table.groups.iter().enumerate() {
        if at == 0 || group.heading.is_some() {
            text.push_str(if at == 0 { "\\midrule\n\n" } else { "\n\\midrule\n" });
        }
        push_group(&mut text, group, table);
    }
    text.push_str("\n\\bottomrule\n\\end{tabular}%\n}\n");
    let _ = writeln!(text, "\\caption{{{}}}", caption(table));
    if let Some(label) = &table.label {
        let _ = writeln!(text, "\\label{{{}}}", identifier(label));
    }
    text.push_str("\\end{table*}\n");
    text
}

fn header(table: &Table) -> String {
    let mut cells = vec![format!("\\textbf{{{}}}", escape(&table.row_heading))];
    cells.extend(table.columns.iter().map(|column| {
        let arrow = match column.better {
            Better::Higher => " $\\uparrow$",
            Better::Lower => " $\\downarrow$",
            Better::Neither => "",
        };
        format!("\\textbf{{{}}}{arrow}", column_name(column))
    }));
    format!("{} \\\\", cells.join(" & "))
}

fn column_name(column: &Column) -> String {
    column.latex.clone().unwrap_or_else(|| escape(&column.metric))
}

fn push_group(text: &mut String, group: &RowGroup, table: &Table) {
    if let Some(heading) = &group.heading {
        let width = table.columns.len() + 1;
        let heading = escape(heading);
        let _ = write!(
            text,
            "\\rowcolor{{gray!15}}\n\\multicolumn{{{width}}}{{c}}{{\\textbf{{{heading}}}}} \\\\\n\\midrule\n"
        );
    }
    for row in &group.rows {
        text.push_str(&line(row, table));
        text.push('\n');
    }
}

fn line(row: &Row, table: &Table) -> String {
    let mut cells = vec![format!("\\texttt{{{}}}", escape(&row.name))];
    cells.extend(row.cells.iter().map(|cell| spell(cell, table)));
    format!("{} \\\\", cells.join(" & "))
}

fn spell(cell: &Cell, table: &Table) -> String {
    let mark = if cell.is_marked { "$^{\\dagger}$" } else { "" };
    let math = |body: &str| match cell.emphasis {
        Emphasis::Plain => format!("${body}$"),
        Emphasis::Bold => format!("$\\mathbf{{{body}}}$"),
        Emphasis::Underline => format!("$\\underline{{{body}}}$"),
    };
    match &cell.value {
        Value::Undefined => escape(&table.undefined),
        Value::MeanSe { mean, se: Some(se) } => format!("{}{mark}", math(&format!("{mean} \\pm {se}"))),
        value => match value.parts(&table.undefined) {
            (estimate, None) => format!("{}{mark}", math(&estimate)),
            // A hyphen before a digit is a minus sign only in mathematics.
            (estimate, Some(detail)) => format!("{}{mark} {}", math(&estimate), detail.replace('-', "$-$")),
        },
    }
}

fn caption(table: &Table) -> String {
    let mut caption = format!("\\textbf{{{}}}.", escape(&table.title));
    for sentence in table.sentences() {
        caption.push(' ');
        caption.push_str(&prose(sentence, &table.columns));
    }
    caption
}

/// Escaped text in which a metric that has a LaTeX header is set as its header is.
fn prose(text: &str, columns: &[Column]) -> String {
    let words = text.split_inclusive(|c: char| !is_word(c));
    words
        .map(|word| {
            let name = word.trim_end_matches(|c| !is_word(c));
            match columns.iter().find(|column| column.metric == name) {
                Some(column) => column_name(column) + &escape(&word[name.len()..]),
                None => escape(word),
            }
        })
        .collect()
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '-'
}

/// A label without what would end it or start a command.
fn identifier(label: &str) -> String {
    label.chars().filter(|c| c.is_alphanumeric() || ":-_.".contains(*c)).collect()
}

/// Text in which nothing is a command: each special character as the command that prints it.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in visible(text).chars() {
        match c {
            '\\' => escaped.push_str("\\textbackslash{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '<' => escaped.push_str("\\textless{}"),
            '>' => escaped.push_str("\\textgreater{}"),
            '|' => escaped.push_str("\\textbar{}"),
            '"' => escaped.push_str("\\textquotedbl{}"),
            '`' => escaped.push_str("\\textasciigrave{}"),
            '{' | '}' | '_' | '&' | '%' | '$' | '#' => escaped.extend(['\\', c]),
            '–' => escaped.push_str("--"),
            '—' => escaped.push_str("---"),
            '±' => escaped.push_str("$\\pm$"),
            DAGGER => escaped.push_str("$^{\\dagger}$"),
            other => escaped.push(other),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::escape;

    #[test]
    fn no_name_is_a_command() {
        for (text, expected) in [
            ("GPT 5.1", "GPT 5.1"),
            ("a_b & 50% $x$ #1", "a\\_b \\& 50\\% \\$x\\$ \\#1"),
            ("\\input{/etc/passwd}", "\\textbackslash{}input\\{/etc/passwd\\}"),
            ("x^2~y", "x\\textasciicircum{}2\\textasciitilde{}y"),
            ("Self–other", "Self--other"),
            ("one\n\ntwo", "one\\textbackslash{}u\\{a\\}\\textbackslash{}u\\{a\\}two"),
        ] {
            assert_eq!(escape(text), expected);
        }
    }
}
