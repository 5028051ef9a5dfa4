//! Other engines that run the SQL lowering of a plan: Polars in this process, Spark on a cluster.
//!
//! Rule: an engine returns the same [`EpisodeTable`](score::table::EpisodeTable) as the native one, or an error; never
//! a different table.
//!
//! ```
//! use mirrorstats_engines::spark::setting::Setting;
//!
//! let setting: Setting = "spark.hadoop.fs.s3a.secret.key=abc".parse()?;
//! assert_eq!(format!("{setting:?}"), "spark.hadoop.fs.s3a.secret.key=...");
//! # Ok::<(), mirrorstats_engines::spark::setting::SettingError>(())
//! ```

#![warn(clippy::print_stdout, clippy::print_stderr)]

#[cfg(feature = "polars")]
pub mod polars;
pub mod spark;
