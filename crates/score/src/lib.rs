//! A checked plan over Arrow batches: one row per episode.
//!
//! ```text
//! metric::plan ──► physical/ ──► evaluate.rs ──► builder.rs ──► table.rs, format/
//! (logical plan)   (kernels      (one batch,     (columns,       (in memory, or as Parquet,
//!                   chosen)       vectors)        one order)      CSV, JSON lines)
//! ```
//!
//! `score_traces.rs` is the one scan that feeds it. Rule: pure. No file is opened here, no clock read, no thread started.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod builder;
pub mod columns;
pub mod declared_experiments;
mod elementwise;
pub mod error;
pub mod evaluate;
pub mod evidence;
pub mod flips;
pub mod format;
mod joined;
pub mod lost_counts;
mod order;
pub mod physical;
pub mod quality;
pub mod score_traces;
pub mod segments;
pub mod select;
pub mod table;
pub mod timeline;
mod vectors;
