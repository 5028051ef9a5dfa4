//! Tables as LaTeX: booktabs, in the paper's layout.

use std::fmt::Write as _;

use super::{Align, Column, DAGGER, Emphasis, Look, RowGroup, Table, TableCell};
use exact::escape::visible;
use metric::catalog::Better;

const PACKAGES: &str =
    "% Needs in the preamble: \\usepackage{booktabs}, \\usepackage{graphicx}, \\usepackage[table]{xcolor}\n";

impl Table {
    /// As LaTeX; needs the packages booktabs and graphicx; a sheet also needs xcolor with its option `table`.
    pub fn latex(&self) -> String {
        let is_sheet = self.look == Look::Sheet;
        let (packages, blank) = if is_sheet { (PACKAGES, "\n") } else { ("", "") };
        let columns: String = self.columns.iter().map(|c| if c.align == Align::Left { 'l' } else { 'c' }).collect();
        let header = line(self.columns.iter().map(|column| header(column, is_sheet)));
        let mut text = format!(
            "{packages}\\begin{{table*}}[t]\n\\centering\n\\resizebox{{\\textwidth}}{{!}}{{%\n\\begin{{tabular}}{{{columns}}}\n\\toprule\n{header}"
        );
        for (at, group) in self.groups.iter().enumerate() {
            if at == 0 || group.heading.is_some() {
                let (before, after) = if at == 0 { ("", blank) } else { (blank, "") };
                let _ = write!(text, "{before}\\midrule\n{after}");
            }
            push_group(&mut text, group, self);
        }
        let _ = writeln!(text, "{blank}\\bottomrule\n\\end{{tabular}}%\n}}\n\\caption{{{}}}", caption(self));
        if let Some(label) = &self.label {
            let _ = writeln!(text, "\\label{{{}}}", identifier(label));
        }
        text.push_str("\\end{table*}\n");
        text
    }
}

fn line(cells: impl Iterator<Item = String>) -> String {
    format!("{} \\\\\n", cells.collect::<Vec<_>>().join(" & "))
}

fn header(column: &Column, is_sheet: bool) -> String {
    let arrow = match column.better {
        Better::Higher => " $\\uparrow$",
        Better::Lower => " $\\downarrow$",
        Better::Neither => "",
    };
    if is_sheet { format!("\\textbf{{{}}}{arrow}", column_name(column)) } else { column_name(column) }
}

fn column_name(column: &Column) -> String {
    column.latex.clone().unwrap_or_else(|| escape(&column.heading))
}

fn push_group(text: &mut String, group: &RowGroup, table: &Table) {
    if let Some(heading) = &group.heading {
        let (width, heading) = (table.columns.len(), escape(heading));
        let _ = write!(
            text,
            "\\rowcolor{{gray!15}}\n\\multicolumn{{{width}}}{{c}}{{\\textbf{{{heading}}}}} \\\\\n\\midrule\n"
        );
    }
    for row in &group.rows {
        let is_name = |at: usize| table.look == Look::Sheet && at < table.names;
        *text +=
            &line(row.iter().enumerate().map(|(at, cell)| {
                if is_name(at) { format!("\\texttt{{{}}}", escape(&cell.text)) } else { spell(cell) }
            }));
    }
}

fn spell(cell: &TableCell) -> String {
    if !cell.is_number {
        return escape(&cell.text);
    }
    let mark = if cell.is_marked { "$^{\\dagger}$" } else { "" };
    let math = |body: &str| match cell.emphasis {
        Emphasis::Plain => format!("${body}$"),
        Emphasis::Bold => format!("$\\mathbf{{{body}}}$"),
        Emphasis::Underline => format!("$\\underline{{{body}}}$"),
    };
    match &cell.detail {
        None => format!("{}{mark}", math(&cell.text)),
        Some(detail) if cell.is_whole => {
            format!("{}{mark}", math(&format!("{} {}", cell.text, detail.replace('±', "\\pm"))))
        }
        // A hyphen before a digit is a minus sign only in math mode.
        Some(detail) => format!("{}{mark} {}", math(&cell.text), detail.replace('-', "$-$")),
    }
}

fn caption(table: &Table) -> String {
    let title = escape(&table.title);
    let mut caption = match table.look {
        Look::Sheet => format!("\\textbf{{{title}}}."),
        Look::Plain | Look::Ruled | Look::Framed => format!("\\textbf{{{title}.}}"),
    };
    for sentence in &table.sentences {
        caption.push(' ');
        caption.push_str(&prose(sentence, &table.columns[table.names..]));
    }
    caption
}

fn prose(text: &str, columns: &[Column]) -> String {
    let words = text.split_inclusive(|c: char| !is_word(c));
    words
        .map(|word| {
            let name = word.trim_end_matches(|c| !is_word(c));
            match columns.iter().find(|column| column.heading == name) {
                Some(column) => column_name(column) + &escape(&word[name.len()..]),
                None => escape(word),
            }
        })
        .collect()
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '-'
}

/// A label without characters that would end it or start a command.
fn identifier(label: &str) -> String {
    label.chars().filter(|c| c.is_alphanumeric() || ":-_.".contains(*c)).collect()
}

pub(crate) fn escape(text: &str) -> String {
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
    fn commands_in_names_are_escaped() {
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
