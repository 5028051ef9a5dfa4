//! A checked plan over Arrow batches: one row per episode.
//!
//! ```text
//! mirrorstats_metric::logical_plan::plan ──► physical/ ──► kernels/ ────► tables/ ─────► format/
//! (logical plan)   (kernels      (one batch,    (columns,      (Parquet, CSV,
//!                   chosen)       vectors)       one order)     JSON lines)
//! ```
//!
//! ```
//! use std::num::NonZeroUsize;
//!
//! use mirrorstats_score::score_traces::{Request, definitions, score};
//!
//! # let paper = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper");
//! let traces = mirrorstats_trace::read::open::TraceSet::open(&mirrorstats_trace::inputs::resolve(&[paper.into()], std::io::empty())?)?;
//! let paper = definitions(&traces, &Request::of("paper"))?;
//! let episodes = score(&traces, &paper, &[], NonZeroUsize::MIN)?;
//! assert_eq!(episodes.len(), 840);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `score_traces.rs` is the one scan that feeds it. Rule: pure. It opens no file, reads no clock and starts no thread.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod cells;
pub mod error;
pub mod evidence;
pub mod flips;
pub mod format;
pub mod kernels;
pub mod physical;
pub mod quality;
pub mod score_traces;
pub mod tables;
pub mod timeline;
pub mod vocabulary;
