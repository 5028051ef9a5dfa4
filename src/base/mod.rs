//! What every room stands on: exact numbers and their text, hashes, near names, sorted runs, repeats, bits, files replaced.
//!
//! Rule: nothing here knows an episode, a metric or a file format.

pub mod beside;
pub mod bits;
pub mod estimate;
pub mod frame;
pub mod hash;
pub mod near;
pub mod number;
pub mod palette;
pub mod ratio;
pub mod repeats;
pub mod replace;
pub mod runs;
pub mod visible;
