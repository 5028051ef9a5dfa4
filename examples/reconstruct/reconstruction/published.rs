//! The published cells: two tables and the values in the running text, as printed.
//!
//! Rule: numbers stay text here, because the reconstruction must match the printed form.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::errata;

/// The source of a printed value; each source has its own rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The result table of the main text.
    Main,
    /// The extended table of the appendix.
    Appendix,
    /// The running text, with three decimals.
    Prose,
}

impl Source {
    /// All places.
    pub const ALL: [Self; 3] = [Self::Main, Self::Appendix, Self::Prose];

    /// The committed copy of the source.
    const fn csv(self) -> &'static str {
        match self {
            Self::Main => include_str!("../../../fixtures/published/main_table.csv"),
            Self::Appendix => include_str!("../../../fixtures/published/appendix_table.csv"),
            Self::Prose => include_str!("../../../fixtures/published/prose.csv"),
        }
    }
}

/// A mean and its standard error, as printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Value {
    /// The mean.
    pub mean: String,
    /// The standard error.
    pub se: String,
}

/// One printed value of a cell; `None` if the paper prints `--`, undefined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Print {
    /// The source.
    pub source: Source,
    /// The value.
    pub value: Option<Value>,
}

/// Everything printed about one model in one experiment.
#[derive(Clone, Debug)]
pub struct Pair {
    /// `E1`..`E5`.
    pub experiment: String,
    /// The model as tables name it.
    pub model: String,
    /// The printed values of each metric.
    pub prints: BTreeMap<String, Vec<Print>>,
}

impl Pair {
    /// The printed values of a metric; empty if nothing about it is printed.
    pub fn prints(&self, metric: &str) -> &[Print] {
        self.prints.get(metric).map_or(&[], Vec::as_slice)
    }
}

/// The treatment of the paper's known errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// As printed, to show the contradictions.
    AsPrinted,
    /// With the corrections of [`errata`].
    Corrected,
}

/// One line of a published file.
#[derive(Deserialize)]
pub struct Row {
    /// `E1`..`E5`.
    pub experiment: String,
    /// The model as tables name it.
    pub model: String,
    /// The metric's name.
    pub metric: String,
    mean: String,
    se: String,
}

impl Row {
    /// The value; `None` if the mean is empty.
    pub fn value(&self) -> Option<Value> {
        (!self.mean.is_empty()).then(|| Value { mean: self.mean.clone(), se: self.se.clone() })
    }
}

/// The lines of one source, in order.
pub fn rows(source: Source) -> Vec<Row> {
    csv::Reader::from_reader(source.csv().as_bytes())
        .deserialize()
        .collect::<Result<_, _>>()
        .expect("the committed copies of the published values have these columns")
}

/// The 40 pairs of experiment and model, in the order of the main table.
pub fn pairs(reading: Reading) -> Vec<Pair> {
    let mut pairs: Vec<Pair> = Vec::new();
    for source in Source::ALL {
        for row in rows(source) {
            let value = match reading {
                Reading::AsPrinted => row.value(),
                Reading::Corrected => errata::corrected(source, &row),
            };
            let known = pairs.iter().position(|pair| pair.experiment == row.experiment && pair.model == row.model);
            let at = known.unwrap_or_else(|| {
                pairs.push(Pair { experiment: row.experiment, model: row.model, prints: BTreeMap::new() });
                pairs.len() - 1
            });
            pairs[at].prints.entry(row.metric).or_default().push(Print { source, value });
        }
    }
    pairs
}
