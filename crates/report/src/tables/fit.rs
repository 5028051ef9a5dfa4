//! Fits tables and sentences into a given width, and leaves nothing out.
//!
//! A table that is too wide is made narrower step by step: cells wrap at spaces, long names wrap anywhere, and at last the
//! columns go into several tables below each other, each with the columns that name its rows.

use comfy_table::{ColumnConstraint, Table, Width};
use unicode_width::{UnicodeWidthChar, UnicodeWidthStr};

/// Spaces that a column has around its text.
const PADDING: usize = 2;

/// The columns that a column takes besides its text: spaces, and what stands between it and the next.
const AROUND: usize = PADDING + 1;

/// The width that the columns of names keep before the others move into a table below.
const LEAST_NAME: usize = 16;

/// A column of a table that is too wide: how wide its text is and has to be.
#[derive(Clone, Copy)]
struct Column {
    at: usize,
    natural: usize,
    least: usize,
}

/// The text of a table, its lines at most `width` columns wide, of any width if that is none. The first `names` columns
/// name the rows.
pub fn fitted(table: &Table, names: usize, width: Option<usize>) -> String {
    let text = |table: &Table| table.trim_fmt();
    let Some(width) = width.filter(|width| widest_line(table) > *width) else { return text(table) };
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
        text(&part)
    });
    texts.collect::<Vec<_>>().join("\n\n")
}

fn widest_line(table: &Table) -> usize {
    table.lines().map(|line| line.trim_end().width()).max().unwrap_or(0)
}

fn columns(table: &Table, names: usize, width: usize) -> Vec<Column> {
    let natural = table.column_max_content_widths();
    let mut columns: Vec<Column> =
        natural.iter().enumerate().map(|(at, width)| Column { at, natural: usize::from(*width), least: 1 }).collect();
    let cells = table.header().into_iter().chain(table.row_iter()).flat_map(|row| row.cell_iter().enumerate());
    for (at, cell) in cells {
        let longest = cell.content().split_whitespace().map(UnicodeWidthStr::width).max().unwrap_or(0);
        // A number that goes on in the next line reads as two; a name does not, nor does what fills half a line.
        let most = if at < names { LEAST_NAME } else { LEAST_NAME.max(width / 2) };
        columns[at].least = columns[at].least.max(longest.min(most));
    }
    columns
}

/// Which columns stand in which table, and the width of their text.
fn blocks(names: &[Column], values: &[Column], width: usize) -> Vec<Vec<(Column, usize)>> {
    let needed = |columns: &[Column]| columns.iter().map(|column| column.least + AROUND).sum::<usize>();
    let mut blocks = Vec::new();
    let mut rest = values;
    loop {
        let mut count = rest.len();
        while count > 1 && needed(names) + needed(&rest[..count]) > width {
            count -= 1;
        }
        let block: Vec<Column> = names.iter().chain(&rest[..count]).copied().collect();
        blocks.push(narrowed(&block, width));
        rest = &rest[count..];
        if rest.is_empty() {
            return blocks;
        }
    }
}

/// The widths of columns that together fit: the widest give way first, as far as they can.
fn narrowed(columns: &[Column], width: usize) -> Vec<(Column, usize)> {
    let mut widths: Vec<(Column, usize)> = columns.iter().map(|column| (*column, column.natural)).collect();
    let total = |widths: &[(Column, usize)]| widths.iter().map(|(_, width)| width + AROUND).sum::<usize>();
    let mut excess = total(&widths).saturating_sub(width);
    while excess > 0 {
        let givable = widths.iter_mut().filter(|(column, width)| *width > column.least);
        let Some((_, widest)) = givable.max_by_key(|(_, width)| *width) else { break };
        *widest -= 1;
        excess -= 1;
    }
    widths
}

/// `text` in lines of at most `width` columns where its words allow; lines after the first begin with `indent` spaces.
pub fn wrapped(text: &str, width: usize, indent: usize) -> Vec<String> {
    let words = text.trim_start_matches(' ');
    let mut lines = vec![" ".repeat(text.len() - words.len())];
    // The columns of the last line, and whether a word stands in it.
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

/// `text` in lines of at most `width` columns; words that are wider are broken anywhere.
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
    use comfy_table::{CellAlignment, Table, presets};
    use unicode_width::UnicodeWidthStr;

    use super::{broken, fitted, wrapped};

    fn table(columns: usize, rows: usize) -> Table {
        let mut table = Table::new();
        table.load_style(presets::NOTHING);
        let name = |at: usize| format!("organisation/model-{at:02}-instruct-2025-long-name");
        table.set_header(["model".to_owned()].into_iter().chain((0..columns).map(|at| format!("metric {at}"))));
        for row in 0..rows {
            let numbers = (0..columns).map(|at| format!("0.{row:02}{at:02} [0.1000, 0.9000]"));
            table.add_row([name(row)].into_iter().chain(numbers));
        }
        for column in table.column_iter_mut().skip(1) {
            column.set_cell_alignment(CellAlignment::Right);
        }
        table
    }

    #[test]
    fn a_table_fits_and_keeps_every_word() {
        let table = table(8, 20);
        for width in [40, 60, 80, 100, 140] {
            let text = fitted(&table, 1, Some(width));
            assert!(text.lines().all(|line| line.width() <= width), "{width}:\n{text}");
            for (row, at) in (0..20).flat_map(|row| (0..8).map(move |at| (row, at))) {
                assert!(text.contains(&format!("0.{row:02}{at:02}")), "{width}: row {row}, metric {at}");
            }
            let letters = |text: &str| text.chars().filter(|c| !c.is_whitespace()).collect::<String>();
            assert!(letters(&text).len() >= letters(&table.to_string()).len());
        }
    }

    #[test]
    fn a_table_that_fits_stays_as_it_is() {
        let table = table(2, 3);
        let whole = table.trim_fmt();
        let width = whole.lines().map(UnicodeWidthStr::width).max().unwrap();
        assert_eq!([None, Some(width)].map(|width| fitted(&table, 1, width)), [whole.clone(), whole.clone()]);
        assert_ne!(fitted(&table, 1, Some(width - 1)), whole);
    }

    #[test]
    fn sentences_and_names_are_broken_into_lines() {
        assert_eq!(wrapped("- one two three", 9, 2), ["- one two", "  three"]);
        assert_eq!(wrapped("", 9, 2), [""]);
        assert_eq!(wrapped("  - a  b", usize::MAX, 4), ["  - a  b"]);
        assert_eq!(broken("one twothreefour", 6), ["one", "twothr", "eefour"]);
        assert_eq!(broken("日本語の名前", 5), ["日本", "語の", "名前"]);
    }
}
