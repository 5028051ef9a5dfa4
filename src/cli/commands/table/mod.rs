//! Published tables and reports that are already written.

pub mod audit;
pub mod compare;
pub mod rescore;
pub mod verify;
