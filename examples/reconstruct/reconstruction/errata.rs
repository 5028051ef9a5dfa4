//! The errors in the published tables: the printed value, the value to read instead, and the reason.
//!
//! Rule: a cell is listed only if no integers explain it as printed. A test compares this list with the contradictions
//! that the solver finds.

use std::fmt;

use super::published::{Row, Source, Value};

/// One error in the main table.
#[derive(Debug, PartialEq, Eq)]
pub struct Erratum {
    /// `E1`..`E5`.
    pub experiment: &'static str,
    /// The model as tables name it.
    pub model: &'static str,
    /// The metric's name.
    pub metric: &'static str,
    /// Mean and standard error to read instead; `None` if undefined.
    pub read_as: Option<(&'static str, &'static str)>,
    /// The reason why.
    pub reason: &'static str,
}

/// All errata.
pub const ERRATA: [Erratum; 3] = [
    Erratum {
        experiment: "E3",
        model: "Gemma4 26B",
        metric: "TTD",
        read_as: Some(("57.91", "10.07")),
        reason: "a mean of 21 integers near 57.90 can only be 1216/21 = 57.9048, which the table's rounding prints as \
                 57.91",
    },
    Erratum {
        experiment: "E2",
        model: "Ministral 3 14B",
        metric: "MTATO",
        read_as: None,
        reason: "no episode succeeds, so by the paper's own definition the value is undefined",
    },
    Erratum {
        experiment: "E5",
        model: "Ministral 3 14B",
        metric: "MTATO",
        read_as: None,
        reason: "no episode succeeds, so by the paper's own definition the value is undefined",
    },
];

impl fmt::Display for Erratum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.read_as {
            Some((mean, se)) => write!(f, "read as {mean} ± {se}: {}", self.reason),
            None => write!(f, "read as undefined: {}", self.reason),
        }
    }
}

/// The erratum of a cell of the main table, if any.
pub fn of(experiment: &str, model: &str, metric: &str) -> Option<&'static Erratum> {
    ERRATA.iter().find(|erratum| (erratum.experiment, erratum.model, erratum.metric) == (experiment, model, metric))
}

/// The corrected value of a line of a published file.
pub fn corrected(source: Source, row: &Row) -> Option<Value> {
    match of(&row.experiment, &row.model, &row.metric) {
        Some(erratum) if source == Source::Main => {
            erratum.read_as.map(|(mean, se)| Value { mean: mean.to_owned(), se: se.to_owned() })
        }
        _ => row.value(),
    }
}
