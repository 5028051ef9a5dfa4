//! Checks of stored values.

pub(crate) mod statistics;
pub mod verify;
