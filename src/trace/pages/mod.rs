//! The pages of Parquet files: verified as they are stored, and decoded without expanding rows where encodings allow it.
//!
//! `bytes` reads, `header` and `verified` check headers and checksums before anything is decoded. Then either of two
//! decodes. `cursor` is the fast one: what traces are mostly made of is stored as runs and as keys into small
//! dictionaries, so a column that is constant in an episode stays runs, truth values stay bits, texts stay keys. `library`
//! is the Parquet library, on pages whose levels and keys `contents` checked before.
//!
//! Rule: `cursor` is a short cut and nothing more. Whatever it does not expect, be it another encoding or damage, is
//! [`Unfit`], and the library's path decodes the column or says what is wrong with it.

mod bytes;
mod contents;
mod cursor;
mod dictionary;
mod header;
mod hybrid;
mod library;
mod reader;
mod spread;
mod verified;

use std::sync::Arc;

use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData};

pub(super) use bytes::Store;
pub(super) use cursor::{Cursor, Form};
pub(super) use library::Library;
pub(super) use verified::FaultSlot;

use super::finding::{Code, Finding};
use super::footer::rows_of;
use verified::{PageFault, Verified};

/// Pages that the short cut does not take.
pub(super) struct Unfit;

/// One column of one row group of a file.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    /// The file's footer.
    pub(super) metadata: &'a ParquetMetaData,
    pub(super) row_group: usize,
    /// The column, counted among the leaves of the schema.
    pub(super) column: usize,
}

impl<'a> Place<'a> {
    fn chunk(self) -> &'a ColumnChunkMetaData {
        self.metadata.row_group(self.row_group).column(self.column)
    }

    fn rows(self) -> usize {
        rows_of(self.metadata.row_group(self.row_group))
    }
}

/// Reads all pages of a column, checks their headers and checksums, and decodes none.
pub(super) fn verify(store: &Store, place: Place<'_>, slot: &FaultSlot) -> Result<()> {
    let stored = Verified::new(store, place, Arc::clone(slot));
    stored.map_err(|error| ParquetError::External(Box::new(error)))?.walk()
}

/// The finding about a column that could not be decoded: the fault of its page, or else what the decoder said.
pub(super) fn damaged(file: &str, slot: &FaultSlot, error: &str) -> Finding {
    if let Some(PageFault { row_group, column, offset, expected, found }) = slot.get() {
        let expected = format!("{expected} in the page at byte {offset}");
        Finding::new(Code::CorruptData, file, expected, found).in_row_group(*row_group).in_column(column)
    } else {
        let found = error.split_whitespace().collect::<Vec<_>>().join(" ");
        Finding::new(Code::CorruptData, file, "data that decodes", found)
    }
}
