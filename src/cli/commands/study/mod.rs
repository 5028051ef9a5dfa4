//! Questions to a study.

pub mod diff;
pub mod figure;
pub mod gate;
pub mod plan;
#[cfg(feature = "view")]
pub mod publish;
pub mod query;
pub mod report;
pub mod score;
pub mod stats;
pub mod verify;
#[cfg(feature = "view")]
pub mod view;
