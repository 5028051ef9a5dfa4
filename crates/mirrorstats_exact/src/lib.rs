//! The base of every crate: exact numbers, moments and text, hashes, similar names, limited inputs, atomic file writes.
//!
//! ```
//! use mirrorstats_exact::moments::Moments;
//! use mirrorstats_exact::number::Decimal;
//!
//! let found = [1, 0, 1].into_iter().try_fold(Moments::default(), Moments::with)?;
//! assert_eq!(found.counts(), Some((2, 3)));
//! assert_eq!(Decimal::of_ratio(found.sum, found.n.into(), 2).map(|mean| mean.to_string()).as_deref(), Some("0.67"));
//! # Ok::<(), mirrorstats_exact::moments::MomentOverflow>(())
//! ```
//!
//! Rule: this crate does not know episodes, metrics or file formats.

#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod budget;
pub mod chance;
pub mod escape;
pub mod format;
pub mod hash;
pub mod input;
pub mod moments;
mod names;
pub mod number;
pub mod ratio;
pub mod replace;
pub mod rounding;
pub mod suggest;
