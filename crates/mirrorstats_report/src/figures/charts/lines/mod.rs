//! Figures of one line per model.

pub(crate) mod decision_curve;
pub(crate) mod dose_response;
pub(crate) mod slopes;
