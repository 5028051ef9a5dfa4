//! Recorded episodes again: simulated, as frames, as a film strip.
//!
//! Rule: a replay reads only the trace, whose footer has all that it needs of the world.

pub mod again;
pub mod error;
pub mod filmstrip;
pub mod frames;
pub mod log;
pub mod verify;
