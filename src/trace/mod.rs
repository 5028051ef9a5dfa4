//! What an episode is, on disk and in memory: the schema, the writer, the reader, the rules.
//!
//! Rule: only this room opens traces. It knows no metric.

pub mod episode;
pub mod finding;
pub mod schema;
mod source;
pub mod write;
