//! Stored pages: read, compared with the footer and their checksums, decompressed.

pub(crate) mod bytes;
pub(crate) mod header;
pub(crate) mod reader;
pub(crate) mod verified;
mod zstd;
