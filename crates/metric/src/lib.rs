//! Definition files: metrics as data, checked and planned.
//!
//! ```text
//! file.rs ──► syntax ─────► bind ─────► plan.rs ──► (kernels in score)
//! (TOML)      (SQL text)    (names,     (typed
//!                            types,      operations)
//!                            levels)
//! ```
//!
//! Rule: nothing here knows a trace reader, a batch of steps or a table.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod bind;
pub mod catalog;
pub mod columns;
pub mod definitions;
pub mod explain;
pub mod file;
mod functions;
pub mod implied;
mod measure;
pub mod names;
pub mod overflow;
pub mod plan;
mod print;
pub mod relations;
pub mod restore;
#[cfg(test)]
mod schema_columns;
pub mod shape;
pub mod sql;
pub mod syntax;
