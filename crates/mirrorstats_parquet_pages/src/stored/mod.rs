pub(crate) mod bytes;
pub(crate) mod header;
pub(crate) mod reader;
pub(crate) mod verified;
mod zstd;
