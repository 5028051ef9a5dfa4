//! The pages of Parquet files: verified as they are stored, and decoded without expanding rows where encodings allow it.
//!
//! `bytes` reads, `header` and `verified` check headers and checksums before anything is decoded; `zstd` decompresses the
//! usual codec, the Parquet library the others. Then either of two decodes. `cursor` is the fast one: what traces are mostly
//! made of is stored as runs and as keys into small dictionaries, so a column that is constant in an episode stays runs,
//! truth values stay bits, texts stay keys. `library` is the Parquet library, on pages whose levels and keys `contents`
//! checked before.
//!
//! Rule: `cursor` is a short cut and nothing more. Whatever it does not expect, be it another encoding or damage, is
//! [`Unsupported`], and the library's path decodes the column or says what is wrong with it.

mod bytes;
mod contents;
mod cursor;
mod delta;
mod dictionary;
mod error;
mod header;
mod library;
mod reader;
mod rle;
mod spread;
mod verified;
mod zstd;

use std::sync::Arc;

use parquet::errors::Result;

pub(crate) use bytes::{Place, Store};
pub(crate) use cursor::{Cursor, Form};
pub(crate) use error::{FaultSlot, Unsupported, damaged};
pub(crate) use library::Library;

use verified::Verified;

/// Reads all pages of a column, checks their headers and checksums, and decodes none.
pub(crate) fn verify(store: &Store, place: Place<'_>, slot: &FaultSlot) -> Result<()> {
    Verified::new(store, place, Arc::clone(slot))?.walk()
}
