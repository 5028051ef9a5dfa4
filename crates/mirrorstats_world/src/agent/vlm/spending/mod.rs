pub mod estimate;
pub mod limits;
