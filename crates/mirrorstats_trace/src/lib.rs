//! The definition of an episode, on disk and in memory: the schema, the writer, the reader, the rules.
//!
//! | folder | contents |
//! |---|---|
//! | `schema` | the columns, their types, and their allowed values |
//! | `read` | from bytes to complete episodes: footers, pages, columns, one pass on several threads |
//! | `write` | from episodes to bytes: new traces, merged traces, sealed copies |
//! | `validate` | the rules for complete episodes, alone and together |
//! | `footers` | the declarations of files: clusters, experiments, models, renderers, checksums |
//! | `beside` | lists beside the traces: labels of coders, lost episodes |
//! | `episodes` | one episode in memory: steps, fields, hash, answers, attributions, moments |
//!
//! ```
//! use mirrorstats_trace::inputs::Input;
//! use mirrorstats_trace::read::open::TraceSet;
//!
//! # let paper = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper");
//! let files = mirrorstats_trace::inputs::resolve(&[paper.into()], std::io::empty())?;
//! let traces = TraceSet::open(&files)?;
//! assert_eq!(traces.files().iter().map(|file| file.rows()).sum::<u64>(), 57_314);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `scan` reads for scoring: `read` and `validate` in one pass. Rule: only this crate opens traces. It knows no metric.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod beside;
pub mod catch_panic;
pub mod diagnostic;
pub mod episodes;
pub mod error;
pub mod footers;
pub mod frame;
mod glob_paths;
pub mod info;
pub mod inputs;
pub mod read;
pub mod scan;
pub mod schema;
pub mod validate;
pub mod write;
