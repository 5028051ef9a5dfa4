//! Columns out of the pages of a Parquet file without a value a row, where the encodings allow it.
//!
//! What traces are mostly made of is stored as runs and as keys into small dictionaries. A column that is constant in
//! an episode stays runs, truth values stay bits, texts stay keys. Rule: this is a short cut and nothing more. Whatever
//! it does not expect, be it another encoding or damage, is [`Unfit`], and the Parquet library decodes the column.

mod chunk;
mod cursor;
mod dictionary;
mod hybrid;

pub(super) use cursor::{Cursor, Form};

/// Pages that the short cut does not take.
pub(super) struct Unfit;
