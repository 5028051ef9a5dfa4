//! Definition files: metrics as data, checked and planned.
//!
//! ```text
//! file.rs ──► syntax ─────► bind ─────► logical_plan ──► (kernels in score)
//! (TOML)      (SQL text)    (names,     (typed
//!                            types,      operations)
//!                            levels)
//! ```
//!
//! A definition file can also become one SQL statement:
//!
//! ```
//! use mirrorstats_metric::columns::{Column, Columns, Level, Type};
//! use mirrorstats_metric::definitions::Definitions;
//! use mirrorstats_metric::sql::{Dialect, lower};
//!
//! let columns: Columns = [("reward", Column { ty: Type::Int, level: Level::Step })].into_iter().collect();
//! let text = "[metric.BEST]\ntitle = \"Best reward\"\nunit = \"points\"\nvalue = \"max(reward)\"\n";
//! let definitions = Definitions::from_toml("mine.toml", text, &columns).map_err(|error| error.to_string())?;
//! assert!(lower(&definitions.plan, Dialect::Portable).map_err(|error| error.to_string())?.contains("MAX("));
//! # Ok::<(), String>(())
//! ```
//!
//! Rule: this crate does not know trace readers, batches of steps or tables.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod bind;
pub mod catalogs;
pub mod columns;
pub mod definitions;
pub mod file;
mod functions;
pub mod logical_plan;
pub mod names;
pub mod shape;
pub mod sql;
pub mod syntax;
#[cfg(test)]
mod tests;
