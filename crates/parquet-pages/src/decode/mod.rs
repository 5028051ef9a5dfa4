//! Pages decoded: by the short cut, or checked for the Parquet library.

pub(crate) mod contents;
pub(crate) mod cursor;
mod delta;
mod dictionary;
pub(crate) mod library;
mod rle;
mod spread;
