//! From scores to findings: statistics, comparisons, changes, gates and plans.
//!
//! Rule: this crate knows no traces and no pictures, only cells and the episode table. [`statistics`] answers the
//! questions of a study, [`gate`] whether later episodes are worse than earlier ones, [`plan`] how many episodes a
//! comparison needs, [`changes`] what another scoring changes.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod changes;
pub mod comparable;
pub mod gate;
pub mod plan;
pub mod statistics;
mod study;
