//! Why pages are not decoded: the short cut does not take them, or they are damaged.

use std::fmt;
use std::sync::{Arc, OnceLock};

use crate::diagnostic::{Code, Finding};

/// Pages that the short cut does not take.
pub(crate) struct Unsupported;

/// What is wrong with a page, or with the chunk of pages.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{part}: expected {expected}, found {found}")]
pub(crate) struct PageFault {
    pub(crate) code: Code,
    pub(crate) row_group: usize,
    pub(crate) column: String,
    pub(crate) part: Part,
    pub(crate) expected: String,
    pub(crate) found: String,
}

/// The bytes that something is wrong with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// The page that starts here, with its header.
    Page(u64),
    /// All pages of the column in the row group: from the first byte to before the last.
    Chunk(u64, u64),
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Page(offset) => write!(f, "the page at byte {offset}"),
            Self::Chunk(start, end) => write!(f, "the pages at bytes {start} to {end}"),
        }
    }
}

/// Where the first fault of a column is left for whoever asked for its pages.
pub(crate) type FaultSlot = Arc<OnceLock<PageFault>>;

/// The finding about a column that could not be decoded: the fault of its page, or else what the decoder said.
pub(crate) fn damaged(file: &str, slot: &FaultSlot, error: &str) -> Finding {
    if let Some(PageFault { code, row_group, column, part, expected, found }) = slot.get() {
        let expected = format!("{expected} in {part}");
        Finding::new(*code, file, expected, found).in_row_group(*row_group).in_column(column)
    } else {
        let found = error.split_whitespace().collect::<Vec<_>>().join(" ");
        Finding::new(Code::CorruptData, file, "data that decodes", found)
    }
}
