//! Why pages are not decoded: the short cut does not take them, or they are damaged.

use std::sync::{Arc, OnceLock};

use crate::trace::diagnostic::{Code, Finding};

/// Pages that the short cut does not take.
pub(in crate::trace) struct Unsupported;

/// What is wrong with a page.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the page at byte {offset}: expected {expected}, found {found}")]
pub(in crate::trace) struct PageFault {
    pub(in crate::trace) code: Code,
    pub(in crate::trace) row_group: usize,
    pub(in crate::trace) column: String,
    /// Where in the file the page starts, with its header.
    pub(in crate::trace) offset: u64,
    pub(in crate::trace) expected: String,
    pub(in crate::trace) found: String,
}

/// Where the first fault of a column is left for whoever asked for its pages.
pub(in crate::trace) type FaultSlot = Arc<OnceLock<PageFault>>;

/// The finding about a column that could not be decoded: the fault of its page, or else what the decoder said.
pub(in crate::trace) fn damaged(file: &str, slot: &FaultSlot, error: &str) -> Finding {
    if let Some(PageFault { code, row_group, column, offset, expected, found }) = slot.get() {
        let expected = format!("{expected} in the page at byte {offset}");
        Finding::new(*code, file, expected, found).in_row_group(*row_group).in_column(column)
    } else {
        let found = error.split_whitespace().collect::<Vec<_>>().join(" ");
        Finding::new(Code::CorruptData, file, "data that decodes", found)
    }
}
