//! Decodes pages: by the short cut, or through the Parquet library after a check.

pub(crate) mod contents;
pub(crate) mod cursor;
mod delta;
mod dictionary;
pub(crate) mod library;
mod rle;
