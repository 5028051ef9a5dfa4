//! Intervals of rates and means, withheld for too few values.

pub mod bootstrap;
pub mod clustered;
pub mod coverage;
pub mod interval;
pub(crate) mod quantile;
pub mod random;
