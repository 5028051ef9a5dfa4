//! Checks of stored values.

pub(crate) mod damaged;
pub(crate) mod statistics;
pub mod verify;
