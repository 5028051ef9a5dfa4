//! From cells to bytes: tables, and the folder of a report.
//!
//! Rule: this room sees no trace and no plan, only cells and the episode table.

pub mod statistics;
