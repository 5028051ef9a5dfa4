//! Questions to a study.

pub mod diff;
pub mod figure;
pub mod gate;
pub mod plan;
pub mod query;
pub mod report;
pub mod score;
pub mod stats;
#[cfg(feature = "view")]
pub mod view;
