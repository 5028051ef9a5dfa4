//! The first experiment minus each other one, a model at a time.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Block, Study, counts};
use crate::metric::catalog::Kind;
use crate::score::table::MetricColumn;
use crate::stats::contrast::{newcombe, welch};
use crate::stats::interval::Interval;

/// How much a model's mean differs between two experiments. Samples are taken as independent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Contrast {
    /// The model.
    pub model: String,
    /// The metric.
    pub metric: String,
    /// The experiment that comes first in the definitions.
    pub baseline: String,
    /// The experiment subtracted from it.
    pub against: String,
    /// The defined episodes of the baseline.
    pub n_baseline: u64,
    /// The defined episodes of the other.
    pub n_against: u64,
    /// The baseline's mean minus the other's.
    pub difference: Option<f64>,
    /// Its interval, not adjusted for the number of comparisons.
    pub interval: Option<Interval>,
    /// How the interval was made.
    pub method: Method,
}

/// The interval of a difference of independent means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Newcombe's hybrid score interval, for rates.
    Newcombe,
    /// Welch's t interval, for quantities.
    Welch,
}

impl Contrast {
    /// Every model and metric: the first experiment of the definitions that has episodes, minus each later one.
    pub(super) fn all(study: &Study, confidence: f64) -> Vec<Self> {
        let Some((baseline, others)) = study.experiments.split_first() else { return Vec::new() };
        let mut contrasts = Vec::new();
        for first in &baseline.blocks {
            for second in others.iter().flat_map(|other| &other.blocks).filter(|other| other.model == first.model) {
                let of = |column| Self::of(study, column, first, second, confidence);
                contrasts.extend(study.table.metrics.iter().map(of));
            }
        }
        contrasts
    }

    fn of(study: &Study, column: &MetricColumn, first: &Block, second: &Block, confidence: f64) -> Self {
        let (a, b) = (first.moments(column), second.moments(column));
        let rates = (study.kind(&column.name) == Kind::Rate).then(|| counts(&a).zip(counts(&b))).flatten();
        let (method, interval) = match rates {
            Some((a, b)) => (Method::Newcombe, newcombe(a, b, confidence)),
            None => (Method::Welch, welch(&a, &b, confidence)),
        };
        Self {
            model: first.model.to_owned(),
            metric: column.name.clone(),
            baseline: first.experiment.to_owned(),
            against: second.experiment.to_owned(),
            n_baseline: a.n,
            n_against: b.n,
            difference: a.mean().zip(b.mean()).map(|(a, b)| a - b),
            interval,
            method,
        }
    }
}
