//! What became of the replies, for the terminal and for programs.

use schemars::JsonSchema;
use serde::Serialize;

use report::layout::quality::QualityTable;
use score::quality::{CellKey, Quality, QualityByCell};

/// The replies of one cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CellAnswer {
    /// Whose they are.
    #[serde(flatten)]
    pub key: CellKey,
    /// What became of them.
    #[serde(flatten)]
    pub quality: Quality,
    /// Milliseconds within which half of the replies came.
    pub latency_median_ms: Option<i64>,
    /// Milliseconds within which 95 % of the replies came.
    pub latency_95_ms: Option<i64>,
}

pub(super) fn answers(cells: &QualityByCell) -> Vec<CellAnswer> {
    let answer = |(key, quality): (&CellKey, &Quality)| CellAnswer {
        key: key.clone(),
        quality: quality.clone(),
        latency_median_ms: quality.latency(0.5),
        latency_95_ms: quality.latency(0.95),
    };
    cells.0.iter().map(answer).collect()
}

/// The table, no wider than the terminal; empty without a cell.
pub(super) fn text(cells: &QualityByCell, width: Option<usize>) -> String {
    let table = QualityTable::from_cells(cells);
    table.map_or_else(String::new, |table| table.printed.lines(width))
}
