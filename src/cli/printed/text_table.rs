//! Tables for people: a header, a line, the rows. As wide as their text, on a terminal or in a pipe.

use comfy_table::{CellAlignment, LineStyle, Table, presets};

/// An empty table under this header.
pub(crate) fn listing(header: impl IntoIterator<Item = impl Into<String>>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING.header_separator(LineStyle::none().fill('─').junction('─')));
    table.set_header(header.into_iter().map(Into::into).collect::<Vec<String>>());
    table
}

/// The table with these columns aligned to the right, as numbers are.
pub(crate) fn aligned_right(mut table: Table, columns: impl IntoIterator<Item = usize>) -> Table {
    for column in columns {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// `1 file`, `2 files`.
pub(crate) fn counted(count: impl Into<u64>, noun: &str) -> String {
    match count.into() {
        1 => format!("1 {noun}"),
        count => format!("{count} {noun}s"),
    }
}
