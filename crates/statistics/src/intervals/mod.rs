//! Intervals of rates and means, and the withholding of intervals from few values.

pub mod bootstrap;
pub mod clustered;
pub mod coverage;
pub mod interval;
pub(crate) mod quantile;
pub mod random;
