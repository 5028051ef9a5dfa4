//! What an episode is, on disk and in memory: the schema, the writer, the reader, the rules.
//!
//! Rule: only this room opens traces. It knows no metric.

mod ahead;
pub mod bits;
mod bounds;
pub mod colors;
mod column;
pub(crate) mod contain;
mod decode;
pub mod describe;
pub mod episode;
pub mod finding;
mod footer;
pub(crate) mod footer_shape;
mod ids;
pub mod import;
pub mod in_order;
pub mod info;
pub mod inputs;
mod layout;
pub mod merge;
pub mod open;
mod pages;
mod pass;
pub mod replies;
pub mod restore;
pub mod rewrite;
mod rules;
pub mod scan;
pub mod schema;
mod source;
mod thrift;
pub mod validate;
pub mod verify;
pub mod write;
