//! Answers, notes, errors and exit codes.

pub mod outcome;
pub mod output;
pub mod quality;
pub mod terminal;
pub mod text_table;
