//! A checked plan over Arrow batches: one row an episode.
//!
//! ```text
//! run.rs ──► engine.rs ──► segments.rs, values.rs        rows.rs ──► table.rs, format/
//! (one scan)  (a node, a    (kernels)                    (sorted in   (in memory, or as Parquet,
//!              column)                                    bounded      CSV, JSON lines)
//!                                                         memory)
//! ```
//!
//! Rule: pure. No file is opened here, no clock read, no thread started in a kernel.

pub mod engine;
pub mod evidence;
pub mod format;
mod row_bytes;
pub mod rows;
pub mod run;
pub mod segments;
pub mod select;
pub mod table;
pub mod timeline;
mod values;
