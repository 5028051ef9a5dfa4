//! Groups of episodes and their exact moments; intervals and tests over them.
//!
//! Rule: integers until the last step. Nothing here formats a number or opens a file.

pub mod bootstrap;
pub mod cell;
pub mod cell_interval;
pub mod chance;
pub mod clustered;
pub mod columns;
pub mod competing;
pub mod contrast;
pub mod coverage;
pub mod design;
pub mod diff;
pub mod feasible;
pub mod group;
pub mod holm;
pub mod improvement;
pub mod interval;
pub mod letter_display;
pub mod losses;
pub mod moments;
pub mod outcomes;
pub mod paired;
pub mod power;
mod quantile;
pub mod random;
pub mod restricted;
pub mod sample_size;
pub mod sequential;
pub mod stratified;
pub mod survival;
pub mod tarone;
pub mod unpaired;
