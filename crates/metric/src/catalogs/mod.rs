//! The catalog: metrics as scores, cells and statistics know them.

pub mod catalog;
pub(crate) mod measure;
pub mod relations;
pub mod restore;
