//! The logical plan: typed operations, and their explanation in words.

pub mod explain;
pub mod plan;
