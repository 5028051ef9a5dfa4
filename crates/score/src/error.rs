//! Errors of scoring a batch.

use arrow::error::ArrowError;

use exact::budget::Exceeded;

/// What keeps a batch from being scored.
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
    #[error("`{metric}` leaves 64-bit integers: {reason}; use smaller numbers in its definition")]
    Overflow { metric: String, reason: String },
    #[error("`{metric}` declares the unit `rate`, but an episode has {value}; a rate is 0 or 1 an episode")]
    NotARate { metric: String, value: i64 },
}

/// An error of evaluating a step: its own, or a kernel's, whose metric is found later.
pub(super) enum StepError {
    Engine(EngineError),
    Kernel(ArrowError),
}

impl From<EngineError> for StepError {
    fn from(error: EngineError) -> Self {
        Self::Engine(error)
    }
}

impl From<ArrowError> for StepError {
    fn from(error: ArrowError) -> Self {
        Self::Kernel(error)
    }
}
