//! Definition files: metrics as data, checked and planned.
//!
//! Rule: nothing here knows a trace reader, a file of steps or a table.

pub mod catalog;
