//! Polars in this process: the SQL lowering for scores, and any other query over traces.
//!
//! Rule: Polars reads the traces itself, lazily and streaming, and only the files that were named. It checks
//! nothing, so that the native reader has been over the same columns before a score is believed.

pub mod answer;
pub mod frame;
mod rewrite;
pub mod run;
pub mod score;
pub mod shared_file;
pub mod statement;
pub mod tables;
