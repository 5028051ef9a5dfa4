//! The limits of a recording's spending over all its processes, and its forecast.

pub mod estimate;
mod ledger;
pub mod limits;
pub(super) mod shared_file;
