//! Declarations of a footer: clusters, experiments, answering models, checksums.

pub mod answered;
pub mod checksums;
pub mod declared;
pub mod declared_experiment;
