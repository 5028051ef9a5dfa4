//! The logical plan: typed operations, their text, their explanation, their ranges.

pub mod explain;
pub mod plan;
pub(crate) mod print;
