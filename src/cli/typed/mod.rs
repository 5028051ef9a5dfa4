//! Converts typed arguments to values of the library.

pub mod args;
pub mod experiments;
#[cfg(feature = "sim")]
pub mod options;
pub mod scoring;
