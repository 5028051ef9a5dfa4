//! The finding about a column that could not be decoded.

use parquet_pages::{FaultKind, FaultSlot, PageFault};

use crate::diagnostic::{Code, Finding};

pub(crate) fn damaged(file: &str, slot: &FaultSlot, error: &str) -> Finding {
    if let Some(PageFault { kind, row_group, column, part, expected, found }) = slot.get() {
        let code = match kind {
            FaultKind::Corrupt => Code::CorruptData,
            FaultKind::OverBudget => Code::OverBudget,
        };
        let expected = format!("{expected} in {part}");
        Finding::new(code, file, expected, found).in_row_group(*row_group).in_column(column)
    } else {
        let found = error.split_whitespace().collect::<Vec<_>>().join(" ");
        Finding::new(Code::CorruptData, file, "data that decodes", found)
    }
}
