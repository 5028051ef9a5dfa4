//! Other engines that run the SQL lowering of a plan: Polars in this process, Spark on a cluster.
//!
//! Rule: an engine gives the same [`EpisodeTable`](score::table::EpisodeTable) as the native one, or an error;
//! it never gives another table.

#![warn(clippy::print_stdout, clippy::print_stderr)]

#[cfg(feature = "polars")]
pub mod polars;
pub mod spark;
