pub mod identification;
pub mod model_id;
pub mod renormalize;
