pub mod estimate;
mod ledger;
pub mod limits;
pub(super) mod shared_file;
