//! Groups of episodes and their exact moments; intervals and tests over them.
//!
//! Rule: integers until the last step. Nothing here formats a number or opens a file.

pub mod cell;
pub mod group;
pub mod interval;
pub mod moments;
mod quantile;
