//! Scoring, verified independently: by hand, by plain loops, by an interpreter, and over every layout of files.

#[cfg(feature = "polars")]
mod answers;
mod arrow_columns;
mod author;
mod by_hand;
#[path = "../spark/mod.rs"]
mod by_spark;
mod changes;
mod definitions;
#[cfg(feature = "polars")]
mod differential;
#[cfg(feature = "polars")]
mod domains;
mod expressions;
#[path = "../harness/mod.rs"]
mod harness;
mod interpreter;
mod labels;
mod language;
mod layouts;
#[cfg(feature = "polars")]
mod metamorphic;
mod one_study;
mod plain_loop;
#[cfg(feature = "polars")]
mod query;
mod random;
#[cfg(feature = "polars")]
mod reach;
mod traces;
