//! What every room stands on: exact numbers and their text, hashes, near names, bits, files replaced.
//!
//! Rule: nothing here knows an episode, a metric or a file format.

pub mod bits;
pub mod estimate;
pub mod frame;
pub mod hash;
pub mod near;
pub mod number;
pub mod palette;
pub mod ratio;
pub mod replace;
pub mod visible;
