//! Errors of decoding: pages that the short cut does not support, and damaged pages.

use std::fmt;
use std::sync::{Arc, OnceLock};

#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("pages that only the Parquet library decodes")]
pub struct Unsupported;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// Its bytes contradict the footer, its header or a checksum.
    Corrupt,
    /// It expands beyond the limit for a file of its size.
    OverBudget,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{part}: expected {expected}, found {found}")]
pub struct PageFault {
    pub kind: FaultKind,
    pub row_group: usize,
    pub column: String,
    pub part: Part,
    pub expected: String,
    pub found: String,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Part {
    /// The page that starts here, with its header.
    Page(u64),
    /// All pages of the column in the row group: the byte range, end excluded.
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

/// Holds the first fault of a column, for the caller that asked for its pages.
pub type FaultSlot = Arc<OnceLock<PageFault>>;
