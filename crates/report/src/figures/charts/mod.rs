//! The figures, one file each.

pub(crate) mod completion_gap;
pub(crate) mod decision_curve;
pub mod e5_outcomes;
pub mod film_strip;
pub mod gaze;
pub(crate) mod heatmap;
pub(crate) mod intervals;
pub(crate) mod scatter;
pub mod sensitivity;
pub(crate) mod slopes;
pub(crate) mod spider;
