//! A recorded episode again: re-simulated, as frames, as a film strip.
//!
//! | file | what it knows |
//! |---|---|
//! | `again` | a trace's worlds built anew, its actions repeated, every row held against what comes of it (feature `sim`) |
//! | [`moments`] | which steps of an episode tell its story |
//!
//! Rule: a replay reads the trace alone; what it needs of the world is in the trace's footer.

#[cfg(feature = "sim")]
pub mod again;
pub mod moments;
