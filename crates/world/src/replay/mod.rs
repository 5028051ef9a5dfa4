//! A recorded episode again: re-simulated, as frames, as a film strip.
//!
//! | file | what it knows |
//! |---|---|
//! | `verify` | traces compared with a replay; their frames, log and counts anew (feature `sim`, as the next five) |
//! | `film_strip` | an episode as a row of frames |
//! | `frames` | frames of an episode rendered again, some steps at a time |
//! | `again` | a trace's worlds built anew, its actions repeated, every row compared with what comes of it |
//! | `same_frames` | frames drawn again, compared with the digests of those that agents saw |
//! | `log` | what an episode's log gets, step by step, by a recording or a replay |
//! | [`reparse`] | recorded replies read again by the parser of this program |
//! | [`moments`] | which steps of an episode tell its story |
//!
//! Rule: a replay reads the trace alone; what it needs of the world is in the trace's footer.

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
