//! Lists: a header, a line, the rows. As wide as their text; a terminal may be narrower.
//!
//! A table that is too wide is narrowed step by step: cells wrap at spaces, then long names wrap anywhere. At last the
//! columns go into several tables below each other, each with the columns that name its rows.

use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, LineStyle, Table as Lines, TableStyle, Width, presets,
};
use unicode_width::UnicodeWidthStr;

use super::wrap::push_wrapped;
use crate::{Align, Look, Table};
use mirrorstats_exact::escape::visible;

const PADDING: usize = 2;
/// The width of a column besides its text: spaces, and the separator.
const AROUND: usize = PADDING + 1;
/// The least width of name columns before other columns move into a table below.
const LEAST_NAME: usize = 16;

#[derive(Clone, Copy)]
struct Measured {
    at: usize,
    natural: usize,
    least: usize,
}

pub fn render(table: &Table, width: Option<usize>) -> String {
    let mut text = String::new();
    if !table.title.is_empty() {
        push_wrapped(&mut text, &visible(&table.title), width, 0);
    }
    text += &table.lines(width);
    for sentence in &table.sentences {
        push_wrapped(&mut text, &visible(sentence), width, 0);
    }
    text
}

impl Table {
    /// Only the lines, without title and sentences.
    pub fn lines(&self, width: Option<usize>) -> String {
        fitted(&laid_out(self), self.names, width) + "\n"
    }

    /// For a terminal, with words wrapped so that all columns fit into `width`.
    pub fn wrapped(&self, width: usize) -> String {
        let mut lines = laid_out(self);
        let width = u16::try_from(width).unwrap_or(u16::MAX);
        lines.set_content_arrangement(ContentArrangement::Dynamic).set_width(width);
        lines.trim_fmt() + "\n"
    }
}

fn laid_out(table: &Table) -> Lines {
    let mut lines = Lines::new();
    lines.load_style(style(table.look));
    lines.set_header(table.columns.iter().map(|column| visible(&column.heading)));
    lines.add_rows(table.rows().map(|row| row.iter().map(|cell| visible(&cell.text))));
    for (column, of) in lines.column_iter_mut().zip(&table.columns) {
        column.set_cell_alignment(match of.align {
            Align::Left => CellAlignment::Left,
            Align::Right => CellAlignment::Right,
        });
    }
    lines
}

fn style(look: Look) -> TableStyle {
    match look {
        Look::Plain => presets::NOTHING,
        Look::Ruled | Look::Sheet => presets::NOTHING.header_separator(LineStyle::none().fill('─').junction('─')),
        Look::Framed => presets::UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none()),
    }
}

fn fitted(table: &Lines, names: usize, width: Option<usize>) -> String {
    let Some(width) = width.filter(|width| widest_line(table) > *width) else { return table.trim_fmt() };
    let columns = columns(table, names, width);
    let (names, values) = columns.split_at(names.min(columns.len()));
    let blocks = blocks(names, values, width);
    let texts = blocks.iter().map(|block| {
        let mut part = table.clone();
        for (at, column) in part.column_iter_mut().enumerate() {
            let shown = block.iter().find(|(column, _)| column.at == at);
            column.set_constraint(match shown {
                None => ColumnConstraint::Hidden,
                Some((_, width)) => {
                    let whole = u16::try_from(*width + PADDING).unwrap_or(u16::MAX);
                    ColumnConstraint::Absolute(Width::Fixed(whole))
                }
            });
        }
        part.trim_fmt()
    });
    texts.collect::<Vec<_>>().join("\n\n")
}

fn widest_line(table: &Lines) -> usize {
    table.lines().map(|line| line.trim_end().width()).max().unwrap_or(0)
}

fn columns(table: &Lines, names: usize, width: usize) -> Vec<Measured> {
    let natural = table.column_max_content_widths();
    let mut columns: Vec<Measured> =
        natural.iter().enumerate().map(|(at, width)| Measured { at, natural: usize::from(*width), least: 1 }).collect();
    let cells = table.header().into_iter().chain(table.row_iter()).flat_map(|row| row.cell_iter().enumerate());
    for (at, cell) in cells {
        let longest = cell.content().split_whitespace().map(UnicodeWidthStr::width).max().unwrap_or(0);
        // A number that wraps reads as two; a name does not, nor does a text that fills half a line.
        let most = if at < names { LEAST_NAME } else { LEAST_NAME.max(width / 2) };
        columns[at].least = columns[at].least.max(longest.min(most));
    }
    columns
}

fn blocks(names: &[Measured], values: &[Measured], width: usize) -> Vec<Vec<(Measured, usize)>> {
    let needed = |columns: &[Measured]| columns.iter().map(|column| column.least + AROUND).sum::<usize>();
    let mut blocks = Vec::new();
    let mut rest = values;
    loop {
        let mut count = rest.len();
        while count > 1 && needed(names) + needed(&rest[..count]) > width {
            count -= 1;
        }
        let block: Vec<Measured> = names.iter().chain(&rest[..count]).copied().collect();
        blocks.push(narrowed(&block, width));
        rest = &rest[count..];
        if rest.is_empty() {
            return blocks;
        }
    }
}

fn narrowed(columns: &[Measured], width: usize) -> Vec<(Measured, usize)> {
    let mut widths: Vec<(Measured, usize)> = columns.iter().map(|column| (*column, column.natural)).collect();
    let total = |widths: &[(Measured, usize)]| widths.iter().map(|(_, width)| width + AROUND).sum::<usize>();
    let mut excess = total(&widths).saturating_sub(width);
    while excess > 0 {
        let givable = widths.iter_mut().filter(|(column, width)| *width > column.least);
        let Some((_, widest)) = givable.max_by_key(|(_, width)| *width) else { break };
        *widest -= 1;
        excess -= 1;
    }
    widths
}

#[cfg(test)]
mod tests {
    use unicode_width::UnicodeWidthStr;

    use crate::Table;

    fn table(columns: usize, rows: usize) -> Table {
        let name = |at: usize| format!("organisation/model-{at:02}-instruct-2025-long-name");
        let metrics: Vec<String> = (0..columns).map(|at| format!("metric {at}")).collect();
        let metrics: Vec<&str> = metrics.iter().map(String::as_str).collect();
        let row = |row: usize| {
            let numbers = (0..columns).map(move |at| format!("0.{row:02}{at:02} [0.1000, 0.9000]"));
            [name(row)].into_iter().chain(numbers)
        };
        Table::plain(&["model"], &metrics).with((0..rows).map(row))
    }

    #[test]
    fn a_table_fits_and_keeps_every_word() {
        let table = table(8, 20);
        for width in [40, 60, 80, 100, 140] {
            let text = table.within(Some(width));
            assert!(text.lines().all(|line| line.width() <= width), "{width}:\n{text}");
            for (row, at) in (0..20).flat_map(|row| (0..8).map(move |at| (row, at))) {
                assert!(text.contains(&format!("0.{row:02}{at:02}")), "{width}: row {row}, metric {at}");
            }
            let letters = |text: &str| text.chars().filter(|c| !c.is_whitespace()).count();
            assert!(letters(&text) >= letters(&table.within(None)));
        }
    }

    #[test]
    fn a_table_that_fits_stays_as_it_is() {
        let table = table(2, 3);
        let whole = table.within(None);
        let width = whole.lines().map(UnicodeWidthStr::width).max().unwrap();
        assert_eq!(table.within(Some(width)), whole);
        assert_ne!(table.within(Some(width - 1)), whole);
    }
}
