//! Durations with their unfinished episodes taken as censored.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Block, Experiment, Study};
use crate::score::table::MetricColumn;
use crate::stats::survival::{self, Duration, End, RestrictedMean, Survival, common_horizon};

/// Which metrics are durations that end with a decision, and which metric is defined where there was one.
///
/// The one place where statistics know a metric by name: a definition file does not say that a quantity is censored.
pub const CENSORED: [(&str, &str); 1] = [("TTD", "TSA-C")];

/// One duration of one experiment and model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DurationRow {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The metric.
    pub metric: String,
    /// The episodes with a duration.
    pub n: u64,
    /// Those that finished; the others are censored.
    pub finished: u64,
    /// The arithmetic mean, which takes censored durations as if they were whole.
    pub mean: Option<f64>,
    /// The first step by which half of the episodes are decided (Kaplan-Meier); none where that is never seen.
    pub median: Option<i64>,
    /// The mean up to the horizon, which is the same for all models of the experiment unless it was given.
    pub restricted: Option<RestrictedMean>,
}

impl DurationRow {
    /// Every duration of [`CENSORED`] that the table has, up to `horizon` or, without one, up to the last step
    /// that every model's curve is known to.
    pub(super) fn all(study: &Study, horizon: Option<i64>, confidence: f64) -> Vec<Self> {
        let mut rows = Vec::new();
        for (duration, finished) in CENSORED {
            let Some(columns) = study.column(duration).zip(study.column(finished)) else { continue };
            for experiment in &study.experiments {
                rows.extend(Self::of_experiment(experiment, columns, horizon, confidence));
            }
        }
        rows
    }

    fn of_experiment(
        experiment: &Experiment,
        columns: (&MetricColumn, &MetricColumn),
        horizon: Option<i64>,
        confidence: f64,
    ) -> Vec<Self> {
        let curves: Vec<Option<Survival>> =
            experiment.blocks.iter().map(|block| Survival::of(&durations(block, columns))).collect();
        let horizon = horizon.or_else(|| common_horizon(curves.iter().flatten()));
        let of = |(block, curve): (&Block, &Option<Survival>)| {
            let finished = durations(block, columns).iter().filter(|duration| duration.end == End::Finished).count();
            let moments = block.moments(columns.0);
            Self {
                experiment: block.experiment.to_owned(),
                model: block.model.to_owned(),
                metric: columns.0.name.clone(),
                n: moments.n,
                finished: finished as u64,
                mean: moments.mean(),
                median: curve.as_ref().and_then(Survival::median),
                restricted: curve.as_ref().zip(horizon).and_then(|(curve, at)| curve.restricted_mean(at, confidence)),
            }
        };
        experiment.blocks.iter().zip(&curves).map(of).collect()
    }
}

fn durations(block: &Block, (duration, finished): (&MetricColumn, &MetricColumn)) -> Vec<survival::Duration> {
    let of = |row: usize| {
        let end = if finished.get(row).is_some() { End::Finished } else { End::Unfinished };
        duration.get(row).map(|steps| Duration { steps, end })
    };
    block.rows.clone().filter_map(of).collect()
}
