//! Answers, notes, errors and exit codes.

pub mod outcome;
pub mod output;
pub mod terminal;
