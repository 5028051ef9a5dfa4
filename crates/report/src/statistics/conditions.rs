//! The first experiment minus each other one, a model at a time: what the mirror changes, and the other conditions.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::compare::{Compared, Comparison, adjust};
use super::matching::{Matched, Matching, Scenes};
use super::study::{Block, Study};
use score::table::MetricColumn;

/// How much a model's mean differs between two experiments, by pairs where their scenes agree.
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
    /// How the episodes of the two experiments fit together.
    pub matching: Matching,
    /// The baseline minus the other, adjusted over all models under the same metric and experiments.
    #[serde(flatten)]
    pub comparison: Comparison,
}

impl Contrast {
    /// Every model and metric: the first experiment of the definitions that has episodes, minus each later one.
    pub(super) fn all(study: &Study, horizon: Option<i64>, confidence: f64) -> Vec<Self> {
        let Some((baseline, others)) = study.experiments.split_first() else { return Vec::new() };
        let scenes: Vec<Scenes> = baseline.blocks.iter().map(|block| Scenes::of(study, block)).collect();
        let mut contrasts = Vec::new();
        for other in others {
            let mut family = Vec::new();
            for (first, scenes) in baseline.blocks.iter().zip(&scenes) {
                for second in other.blocks.iter().filter(|block| block.is_same_subject(first)) {
                    let matched = Matched::of(scenes, &Scenes::of(study, second));
                    let compared = Compared { study, first, second, matched: &matched, horizon, confidence };
                    let under = |column| Self::of(first, second, &matched, column, compared.under(column));
                    family.extend(study.table.metrics.iter().map(under));
                }
            }
            for column in &study.table.metrics {
                let of_metric = family.iter_mut().filter(|it: &&mut Self| it.metric == column.name);
                adjust(of_metric.map(|it| &mut it.comparison), confidence);
            }
            contrasts.extend(family);
        }
        contrasts
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
