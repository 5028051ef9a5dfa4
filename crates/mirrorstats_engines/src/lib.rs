//! Other engines: Polars in this process for queries over traces, Spark on a cluster for scores.
//!
//! Rule: an engine returns what the native one would, or an error; never a different table.
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
