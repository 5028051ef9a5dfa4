//! Intervals, tests, survival, power: numbers in, numbers out.
//!
//! Rule: integers until the last step. Nothing here knows a metric or a table, formats a number or opens a file.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod bootstrap;
pub mod chance;
pub mod clustered;
pub mod competing;
pub mod contrast;
pub mod coverage;
pub mod design;
mod endings;
pub mod feasible;
pub mod holm;
pub mod improvement;
pub mod interval;
pub mod letter_display;
pub mod losses;
pub mod margin;
pub mod outcomes;
pub mod paired;
pub mod power;
mod quantile;
pub mod random;
pub mod restricted;
pub mod sample_size;
pub mod sequential;
pub mod stratified;
pub mod survival;
pub mod units;
pub mod unpaired;
