//! Polars in this process: it runs the SQL lowering for scores, and queries over traces.
//!
//! Rule: Polars reads the traces itself, lazily and streaming, and only the named files. It checks nothing, so the
//! native reader checks the same columns before a score is accepted. A query is translated to Polars' expressions here,
//! without Polars' own SQL: what has no translation that agrees with DuckDB is refused.

pub mod accepted;
pub mod answer;
pub mod frame;
mod functions;
mod names;
mod plan;
pub mod refused;
mod relation;
pub mod run;
mod scope;
pub mod score;
mod select;
pub mod shared_file;
pub mod statement;
pub mod tables;
mod value;
mod windows;
