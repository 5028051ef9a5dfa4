//! The quality of replies, for the terminal.

use crate::cli::text_table::listing;
use report::quality::QualityTable;
use report::tables::fit::fitted;
use score::quality::QualityByCell;

/// The table, no wider than the terminal; empty without a cell.
pub(crate) fn text(cells: &QualityByCell, width: Option<usize>) -> String {
    let Some(table) = QualityTable::of(cells) else { return String::new() };
    let keys = if cells.has_conditions() { 3 } else { 2 };
    let mut lines = listing(table.header);
    lines.add_rows(table.rows);
    format!("{}\n", fitted(&lines, keys, width))
}
