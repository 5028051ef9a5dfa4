//! A study: inputs, definitions and a filter, opened and scanned once; every answer is a function of it.
//!
//! ```text
//! Study::open ──► definitions, filter, metrics, by ──► scan ──► episodes, timelines, lost episodes, input hashes
//!                                                              │
//!                                                           grouped ──► counted episodes and cells
//!                                                              │
//!                                     report, figure, statistics, published, sensitivity, ...
//! ```
//!
//! ```
//! # let paper = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper");
//! let study = mirrorstats_study::Study::open([paper])?.filter("experiment = 'E1'")?;
//! assert_eq!(study.score()?.episodes.len(), 168);
//! # Ok::<(), mirrorstats_study::StudyError>(())
//! ```
//!
//! Rule: each input is opened once, and must stay the same until the answer is complete; a file that changes is an
//! error. Nothing here depends on a command line: text for people comes from errors and from `report`.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod agreement;
mod caveats;
pub mod contents;
mod copies;
mod design;
pub mod diff;
mod empty_filter;
mod error;
mod experiment_findings;
pub mod explain;
pub mod figure;
pub mod findings;
pub mod gate;
pub mod import;
pub mod inputs;
pub mod labels;
mod limits;
pub mod losses;
pub mod overview;
pub mod own_definitions;
pub mod pairs;
mod pooled;
pub mod provenance;
pub mod published;
pub mod quality;
#[cfg(feature = "polars")]
pub mod query;
pub mod question;
pub mod report;
pub mod rescore;
pub mod results;
mod scan;
pub mod scores;
pub mod sensitivity;
pub mod spark;
pub mod statistics;
mod study;
mod tables;
pub mod verify;

pub use error::{ErrorKind, StudyError};
pub use study::Study;
