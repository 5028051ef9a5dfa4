//! The quality of replies, for the terminal.

use report::layout::quality;
use score::quality::QualityByCell;

pub(crate) fn text(cells: &QualityByCell, width: Option<usize>) -> String {
    let table = quality::of_cells(cells);
    table.map_or_else(String::new, |table| table.printed.lines(width))
}
