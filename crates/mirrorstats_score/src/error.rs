//! Errors of scoring: of a batch, and of traces.

use super::tables::declared_experiments::DeclarationError;
use mirrorstats_exact::budget::Exceeded;
use mirrorstats_metric::catalogs::restore::RestoreError;
use mirrorstats_metric::definitions::UnknownMetric;
use mirrorstats_metric::file::FileError;
use mirrorstats_toml_spec::Faults;
use mirrorstats_trace::error::TraceError;

#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error(transparent)]
    Exceeded(#[from] Exceeded),
    #[error("the column `{0}` is not in the batch; project every column of the plan")]
    MissingColumn(String),
    #[error(
        "the column `{column}` has the type {found}; expected booleans, 64-bit integers, doubles or a dictionary of text"
    )]
    ColumnType { column: String, found: String },
    #[error("`{metric}` overflows 64-bit integers: {reason}; use smaller numbers in its definition")]
    Overflow { metric: String, reason: String },
    #[error(
        "`{metric}` reads the number {value}; expected a finite number that fits 53 bits with {decimals} decimals; \
         leave it out with `case`, or declare fewer decimals"
    )]
    NotADecimal { metric: String, value: String, decimals: u8 },
    #[error("`{metric}` declares the unit `rate`, but an episode has {value}; a rate is 0 or 1 for each episode")]
    NotARate { metric: String, value: i64 },
}

#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("{0}")]
    Definitions(#[from] FileError),
    #[error(transparent)]
    Carried(#[from] RestoreError),
    #[error(transparent)]
    Declaration(#[from] DeclarationError),
    #[error("{0}")]
    Condition(#[from] Faults),
    #[error(transparent)]
    Metric(#[from] UnknownMetric),
    #[error("`{wanted_by}` reads the column `{column}`: {problem}; {help}")]
    Column { wanted_by: String, column: String, problem: String, help: String },
    #[error("cannot group by `{name}`: expected a column that is constant in an episode, one of {}; {help}", .known.join(", "))]
    Label { name: String, known: Vec<String>, help: String },
    #[error("{file}: {source}")]
    Engine { file: String, source: EngineError },
}
