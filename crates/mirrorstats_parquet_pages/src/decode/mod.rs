pub(crate) mod contents;
pub(crate) mod cursor;
mod delta;
mod dictionary;
pub(crate) mod library;
mod rle;
