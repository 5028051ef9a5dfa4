//! Answers as files: reports with their provenance, figures, checks of quality and of tables.

pub(crate) mod agreement;
pub(crate) mod audit;
pub(crate) mod figure_inputs;
pub(crate) mod overview;
pub(crate) mod provenance;
pub(crate) mod quality_check;
pub(crate) mod report;
pub(crate) mod statistics;
pub mod verify;
