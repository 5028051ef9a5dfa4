//! The first experiment minus each other one, a model at a time: what the mirror changes, and the other conditions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::comparable::tasks_differ;
use crate::statistics::compare::{Compared, Comparison, adjust};
use crate::statistics::matching::{Matched, Matching, Scenes};
use crate::statistics::study::{Block, Experiment, Study};
use score::table::MetricColumn;

/// The difference of a model's mean between two experiments, by pairs if their scenes agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Contrast {
    /// The model.
    pub model: String,
    /// The condition, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// The metric.
    pub metric: String,
    /// The experiment that comes first in the definitions.
    pub baseline: String,
    /// The experiment subtracted from it.
    pub against: String,
    /// The matching of the episodes of the two experiments.
    pub matching: Matching,
    /// The baseline minus the other, adjusted over all models under the same metric and experiments.
    #[serde(flatten)]
    pub comparison: Comparison,
}

impl Contrast {
    pub(in crate::statistics) fn all(study: &Study, horizon: Option<i64>, confidence: f64) -> Vec<Self> {
        let mut contrasts = Vec::new();
        for couples in Self::couples(study).chunk_by(|a, b| a.1.experiment == b.1.experiment) {
            let mut family = Vec::new();
            for &(first, second) in couples {
                let matched = Matched::of(&Scenes::of(study, first), &Scenes::of(study, second));
                let compared = Compared { study, first, second, matched: &matched, horizon, confidence };
                let incomparable = study.incomparable(first, second);
                let under = |column| {
                    let comparison = compared.under(column).unless(incomparable.clone());
                    Self::of(first, second, &matched, column, comparison)
                };
                family.extend(study.table.metrics.iter().map(under));
            }
            for column in &study.table.metrics {
                let of_metric = family.iter_mut().filter(|it: &&mut Self| it.metric == column.name);
                adjust(of_metric.map(|it| &mut it.comparison), confidence);
            }
            contrasts.extend(family);
        }
        contrasts
    }

    pub(in crate::statistics) fn couples<'s, 'a>(study: &'s Study<'a>) -> Vec<(&'s Block<'a>, &'s Block<'a>)> {
        let Some((baseline, others)) = study.experiments.split_first() else { return Vec::new() };
        let is_like = |name| tasks_differ(&study.table.catalog, baseline.name, name).is_none();
        let others = others.iter().filter(|other| is_like(other.name)).flat_map(|other| &other.blocks);
        let same = |second: &'s Block<'a>| {
            baseline.blocks.iter().filter(|first| second.is_same_subject(first)).map(move |first| (first, second))
        };
        others.flat_map(same).collect()
    }

    pub(in crate::statistics) fn left_out(study: &Study) -> Vec<String> {
        let Some((baseline, others)) = study.experiments.split_first() else { return Vec::new() };
        let sentence = |other: &Experiment| {
            let why = tasks_differ(&study.table.catalog, baseline.name, other.name)?;
            Some(format!("{} is not contrasted with {}: {why}.", other.name, baseline.name))
        };
        others.iter().filter_map(sentence).collect()
    }

    fn of(first: &Block, second: &Block, matched: &Matched, column: &MetricColumn, comparison: Comparison) -> Self {
        Self {
            model: first.model.to_owned(),
            condition: first.condition(),
            metric: column.name.clone(),
            baseline: first.experiment.to_owned(),
            against: second.experiment.to_owned(),
            matching: matched.matching,
            comparison,
        }
    }
}
