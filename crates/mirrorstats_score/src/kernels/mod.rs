//! Kernels over vectors: one batch of whole episodes, one vector per step of the plan.

pub(crate) mod elementwise;
pub mod evaluate;
pub mod segments;
pub(crate) mod vectors;
