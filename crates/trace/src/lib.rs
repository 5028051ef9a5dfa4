//! What an episode is, on disk and in memory: the schema, the writer, the reader, the rules.
//!
//! | folder | what it knows |
//! |---|---|
//! | `schema` | which columns there are, what they may hold, how they are had from an episode |
//! | `read` | from bytes to whole episodes: footers, pages, columns, one pass on several threads |
//! | `write` | from episodes to bytes: new traces, traces put together, one column made anew |
//! | `validate` | the rules that whole episodes keep, alone and together |
//! | `import` | from JSON lines to a trace |
//! | `log` | MCAP logs of recordings: written, read, recovered |
//!
//! `scan` reads for scoring: `read` and `validate` in one pass. Rule: only this crate opens traces. It knows no metric.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod answered;
pub mod catch_panic;
pub mod checksums;
pub mod declared;
pub mod declared_experiment;
pub mod diagnostic;
pub mod episode;
pub mod episode_hash;
pub mod error;
pub mod frame;
mod glob_paths;
pub mod identification;
pub mod import;
pub mod info;
pub mod inputs;
pub mod log;
pub mod lost;
pub mod model_id;
pub mod palette;
mod read;
pub mod renderer;
pub mod renormalize;
pub mod replies;
pub mod scan;
pub mod schema;
pub mod validate;
pub mod write;

pub use read::flat::FlatRows;
pub use read::flat::TableFile;
pub use read::{in_order, open, steps, verify};
pub use schema::{colors, describe};
pub use write::merge;
