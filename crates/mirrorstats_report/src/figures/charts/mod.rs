//! The figures, one file each.

pub(crate) mod completion_gap;
pub mod e5_outcomes;
pub mod film_strip;
pub mod gaze;
pub(crate) mod heatmap;
pub(crate) mod intervals;
pub(crate) mod lines;
pub(crate) mod scatter;
pub mod sensitivity;
pub(crate) mod spider;
