//! Intervals, tests, survival, power: numbers in, numbers out.
//!
//! ```
//! use mirrorstats_statistics::intervals::interval::wilson;
//!
//! let rate = wilson(16, 21, 0.95).expect("16 of 21 at 95 %");
//! assert!((rate.low - 0.549).abs() < 0.001 && (rate.high - 0.894).abs() < 0.001);
//! assert_eq!(wilson(0, 0, 0.95), None, "no episode, no interval");
//! ```
//!
//! Rule: integers until the last step. No metrics, tables, formatting of numbers or files here.

#![warn(clippy::print_stdout, clippy::print_stderr)]
#![expect(
    clippy::cast_precision_loss,
    reason = "counts and steps are far below 2^53; exact sums become a quotient last"
)]

pub mod agreement;
pub mod chance;
pub mod design;
pub mod feasible;
pub mod losses;
pub mod outcomes;
pub mod power;
pub mod sample_size;
pub mod sequential;

pub mod comparisons {
    pub mod holm;
    pub mod improvement;
    pub mod letter_display;
    pub mod margin;
    pub mod paired;
    pub mod stratified;
    pub mod trend;
    pub mod units;
    pub mod unpaired;
}
pub mod durations {
    pub mod competing;
    pub mod restricted;
    pub mod survival;
}
pub mod intervals {
    pub mod bootstrap;
    pub mod clustered;
    pub mod coverage;
    pub mod interval;
    pub(crate) mod quantile;
    pub mod random;
}
