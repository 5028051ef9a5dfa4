//! Definition files: metrics as data, checked and planned.
//!
//! ```text
//! file.rs ──► syntax ─────► bind ─────► logical_plan ──► (kernels in score)
//! (TOML)      (SQL text)    (names,     (typed
//!                            types,      operations)
//!                            levels)
//! ```
//!
//! Rule: nothing here knows a trace reader, a batch of steps or a table.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod bind;
mod catalogs;
pub mod columns;
pub mod definitions;
pub mod file;
mod functions;
pub mod implied;
mod logical_plan;
pub mod names;
#[cfg(test)]
mod schema_columns;
pub mod shape;
pub mod sql;
pub mod syntax;

use catalogs::measure;
pub use catalogs::{catalog, relations, restore};

pub use logical_plan::{explain, overflow, plan};
