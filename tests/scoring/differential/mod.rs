//! Two engines that share no code: the kernels, and the SQL lowering on Polars. They must agree on every integer of
//! every episode, or refuse alike.

pub mod property;
pub mod trace;
pub mod words;
