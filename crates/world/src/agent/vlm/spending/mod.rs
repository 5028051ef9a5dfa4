//! What a recording may spend, over all its processes, and what it will.

pub mod estimate;
mod ledger;
pub mod limits;
pub(super) mod shared_file;
mod spend;
