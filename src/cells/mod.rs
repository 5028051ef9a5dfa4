//! Groups of episodes and their exact moments; intervals and tests over them.
//!
//! Rule: integers until the last step. Nothing here formats a number or opens a file.

pub mod bootstrap;
pub mod cell;
pub mod chance;
pub mod changes;
pub mod clustered;
pub mod columns;
pub mod contrast;
pub mod detectable;
pub mod group;
pub mod interval;
pub mod losses;
pub mod moments;
pub mod multiplicity;
pub mod paired;
mod quantile;
pub mod survival;
pub mod tied;
