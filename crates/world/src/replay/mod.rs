//! Recorded episodes again: simulated, as frames, as a film strip.
//!
//! | file | what it knows |
//! |---|---|
//! | `verify` | traces compared with a replay; new frames, logs and counts (feature `sim`, as the next five) |
//! | `film_strip` | an episode as a row of frames |
//! | `frames` | frames of an episode rendered again, some steps at a time |
//! | `again` | a trace's worlds rebuilt, its actions repeated, every row compared |
//! | `same_frames` | replayed frames compared with the digests of those that agents saw |
//! | `log` | the content of an episode's log, step by step, from a recording or a replay |
//! | [`reparse`] | recorded replies parsed again by this program |
//! | [`moments`] | the key steps of an episode |
//!
//! Rule: a replay reads only the trace, whose footer has all that it needs of the world.

#[cfg(feature = "sim")]
pub mod again;
#[cfg(feature = "sim")]
pub mod divergence;
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
pub mod same_frames;
#[cfg(feature = "sim")]
pub mod verify;
