//! Polars in this process: it runs queries over traces.
//!
//! Rule: Polars reads the traces itself, lazily and streaming, and only the named files. A query is translated to
//! Polars' expressions here, without Polars' own SQL: what has no translation that agrees with DuckDB is refused.

pub mod accepted;
pub mod answer;
mod functions;
mod names;
mod plan;
pub mod refused;
mod relation;
pub mod run;
mod scope;
mod select;
pub mod shared_file;
pub mod statement;
pub mod tables;
mod value;
mod windows;
