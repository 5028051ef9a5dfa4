//! Polars in this process: it runs the SQL lowering for scores, and any other query over traces.
//!
//! Rule: Polars reads the traces itself, lazily and streaming, and only the named files. It checks nothing, so the
//! native reader checks the same columns before a score is accepted.

pub mod answer;
pub mod frame;
mod rewrite;
pub mod run;
pub mod score;
pub mod shared_file;
pub mod statement;
pub mod tables;
