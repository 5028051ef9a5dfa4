//! What every crate stands on: exact numbers, their moments and text, hashes, near names, inputs within limits, files replaced whole.
//!
//! Rule: nothing here knows an episode, a metric or a file format.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod budget;
pub mod escape;
pub mod format;
pub mod hash;
pub mod input;
pub mod moments;
mod names;
pub mod number;
pub mod ratio;
pub mod replace;
pub mod rounding;
pub mod suggest;
