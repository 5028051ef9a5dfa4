//! The catalog: metrics for scores, cells and statistics.

pub mod catalog;
pub(crate) mod measure;
pub mod relations;
pub mod restore;
