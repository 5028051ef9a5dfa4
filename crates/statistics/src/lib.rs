//! Intervals, tests, survival, power: numbers in, numbers out.
//!
//! ```
//! use mirrorstats_statistics::interval::wilson;
//!
//! let rate = wilson(16, 21, 0.95).expect("16 of 21 at 95 %");
//! assert!((rate.low - 0.549).abs() < 0.001 && (rate.high - 0.894).abs() < 0.001);
//! assert_eq!(wilson(0, 0, 0.95), None, "no episode, no interval");
//! ```
//!
//! Rule: integers until the last step. No metrics, tables, formatting of numbers or files here.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod agreement;
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

pub use comparisons::{
    contrast, holm, improvement, letter_display, margin, paired, stratified, trend, units, unpaired,
};

use intervals::quantile;
pub use intervals::{bootstrap, clustered, coverage, interval, random};
