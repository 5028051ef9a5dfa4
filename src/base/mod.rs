//! What every room stands on: exact numbers and their text, hashes, near names, inputs read within limits, files replaced.
//!
//! Rule: nothing here knows an episode, a metric or a file format.

pub mod budget;
pub mod escape;
pub mod features;
pub mod format;
pub mod frame;
pub mod hash;
pub mod input;
pub mod model_id;
pub(crate) mod names;
pub mod number;
pub mod palette;
pub mod ratio;
pub mod replace;
pub mod rounding;
pub mod suggest;
#[cfg(feature = "view")]
pub mod web;
