//! Random traces and the words of random definitions, for engines that must agree.

pub mod trace;
pub mod words;
