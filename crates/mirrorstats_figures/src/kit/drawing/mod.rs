//! Lines, letters and colours.

pub(crate) mod dodge;
pub(crate) mod font;
pub(crate) mod ink;
pub(crate) mod label;
pub(crate) mod lettering;
pub(crate) mod look;
pub(crate) mod mark;
pub(crate) mod marker;
pub mod palette;
pub(crate) mod picture;
