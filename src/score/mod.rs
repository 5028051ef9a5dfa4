//! A checked plan over Arrow batches: one row an episode.
//!
//! Rule: pure. No file is opened here, no clock read, no thread started in a kernel.

pub mod engine;
pub mod segments;
pub mod table;
mod values;
