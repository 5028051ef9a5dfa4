//! Rules over free text: attributions and names of models.

pub mod identification;
pub mod model_id;
pub mod renormalize;
