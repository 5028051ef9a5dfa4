//! mirrorstats scores episodes of embodied agents that must recognise themselves in a mirror.

pub mod base;
pub mod cells;
pub mod cli;
pub mod metric;
pub mod report;
pub mod score;
pub mod trace;
