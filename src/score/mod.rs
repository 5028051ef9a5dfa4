//! A checked plan over Arrow batches: one row an episode.
//!
//! ```text
//! run.rs ──► engine.rs ──► segments.rs, values.rs        table.rs ──► format/
//! (one scan,  (a node, a    (kernels)                    (the result)  (as Parquet, CSV, JSON lines)
//!  one table)  column)
//! ```
//!
//! Rule: pure. No file is opened here, no clock read, no thread started in a kernel.

pub mod engine;
pub mod evidence;
pub mod format;
pub mod run;
pub mod segments;
pub mod select;
pub mod table;
pub mod timeline;
mod values;
