//! Times to an event: survival, competing events, restricted means.

pub mod competing;
pub(crate) mod endings;
pub mod restricted;
pub mod survival;
