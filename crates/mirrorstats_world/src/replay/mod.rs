//! Recorded episodes again: simulated, as frames, as a film strip.
//!
//! Rule: a replay reads only the trace, whose footer has all that it needs of the world.

#[cfg(feature = "sim")]
pub mod again;
#[cfg(feature = "sim")]
pub mod error;
#[cfg(feature = "sim")]
pub mod film_strip;
#[cfg(feature = "sim")]
pub mod frames;
#[cfg(feature = "sim")]
pub mod log;
pub mod moments;
pub mod reparse;
#[cfg(feature = "sim")]
pub mod verify;
