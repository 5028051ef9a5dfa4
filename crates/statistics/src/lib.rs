//! Intervals, tests, survival, power: numbers in, numbers out.
//!
//! Rule: integers until the last step. Nothing here knows a metric or a table, formats a number or opens a file.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod chance;
mod comparisons;
pub mod design;
mod durations;
pub mod feasible;
mod intervals;
pub mod losses;
pub mod outcomes;
pub mod power;
pub mod sample_size;
pub mod sequential;

use durations::endings;
pub use durations::{competing, restricted, survival};

pub use comparisons::{contrast, holm, improvement, letter_display, margin, paired, stratified, units, unpaired};

use intervals::quantile;
pub use intervals::{bootstrap, clustered, coverage, interval, random};
