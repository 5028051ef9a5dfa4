//! Errors of scoring a batch.

use arrow::error::ArrowError;

use exact::budget::Exceeded;

/// What keeps a batch from being scored.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// Definitions that ask for too much of the rows.
    #[error(transparent)]
    Exceeded(#[from] Exceeded),
    /// A column of the plan is not in the batch.
    #[error("the column `{0}` is not in the batch; project every column of the plan")]
    MissingColumn(String),
    /// A column has a type that the engine does not take.
    #[error(
        "the column `{column}` has the type {found}; expected booleans, 64-bit integers, doubles or a dictionary of text"
    )]
    ColumnType {
        column: String,
        /// Its Arrow type.
        found: String,
    },
    /// A result beyond 64 bits.
    #[error("`{metric}` leaves 64-bit integers: {reason}; use smaller numbers in its definition")]
    Overflow {
        /// The first metric that needs the number.
        metric: String,
        /// The engine's words.
        reason: String,
    },
    /// A metric that declares itself a rate has another value than 0 or 1.
    #[error("`{metric}` declares the unit `rate`, but an episode has {value}; a rate is 0 or 1 an episode")]
    NotARate {
        metric: String,
        /// The value found.
        value: i64,
    },
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
