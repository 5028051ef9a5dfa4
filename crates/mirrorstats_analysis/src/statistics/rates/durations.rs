//! Durations with unfinished episodes as censored, and the time to a correct decision.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::study::{Block, Experiment, RowKey, Study};
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::durations::competing::{Ending, Incidence, Outcome};
use mirrorstats_statistics::durations::survival::{MedianInterval, RestrictedMean, Survival, common_horizon};
use mirrorstats_statistics::intervals::coverage::{self, Withheld};
use mirrorstats_statistics::intervals::interval::Interval;

/// One duration of one experiment and model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DurationRow {
    #[serde(flatten)]
    pub key: RowKey,
    /// The metric.
    pub metric: String,
    /// The episodes with a duration.
    pub n: u64,
    /// Those that finished; the others are censored.
    pub finished: u64,
    /// The arithmetic mean, which takes censored durations as if they were whole.
    pub mean: Option<f64>,
    /// The first step by which half of the episodes are decided (Kaplan-Meier); none if that is never seen.
    pub median: Option<i64>,
    /// The steps that this may be (Brookmeyer and Crowley).
    pub median_interval: Option<MedianInterval>,
    /// The mean up to the horizon, which is the same for all models of the experiment.
    pub restricted: Option<RestrictedMean>,
    /// The reason why the restricted mean has no interval.
    pub withheld: Option<Withheld>,
    /// The time to a correct decision, up to the same horizon.
    pub correct: Option<CorrectRow>,
}

/// The time to a correct decision; wrong ones compete, unfinished episodes are censored (Aalen and Johansen).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CorrectRow {
    /// The share decided correctly by the horizon.
    pub correct: f64,
    /// The share decided wrongly by then; the rest is undecided.
    pub wrong: f64,
    /// The first step by which half of all episodes are decided correctly; none if that is never seen.
    pub median: Option<i64>,
    /// The mean of the steps to a correct decision, where a wrong decision and none both count as the horizon.
    pub restricted: RestrictedMean,
    /// The reason why it has no interval.
    pub withheld: Option<Withheld>,
}

/// Returns true if a metric is a duration with a known end.
pub(crate) fn is_duration(study: &Study, metric: &str) -> bool {
    study.relations.finished(metric).is_some_and(|finished| study.column(finished).is_some())
}

/// The ending of an episode, with any decision as the event; `None` if the duration is undefined.
pub(crate) fn decided(study: &Study, column: &MetricColumn, row: usize) -> Option<Ending> {
    let ending = ending(study, column, row)?;
    let outcome = if ending.outcome == Outcome::Unfinished { Outcome::Unfinished } else { Outcome::Correct };
    Some(Ending { outcome, ..ending })
}

fn ending(study: &Study, column: &MetricColumn, row: usize) -> Option<Ending> {
    let outcome = match study.column(study.relations.finished(&column.name)?)?.get(row) {
        Some(1) => Outcome::Correct,
        Some(_) => Outcome::Wrong,
        None => Outcome::Unfinished,
    };
    column.get(row).map(|steps| Ending { steps, outcome })
}

/// The horizon of an experiment: the last step at which every model's curve is known.
pub(crate) fn horizon_of(study: &Study, experiment: &Experiment, column: &MetricColumn) -> Option<i64> {
    let curves: Vec<Survival> = experiment.blocks.iter().filter_map(|block| curve(study, block, column)).collect();
    common_horizon(&curves)
}

/// The mean up to the horizon, with each unit counted once.
pub(crate) fn restricted(study: &Study, block: &Block, column: &MetricColumn, horizon: i64) -> Option<f64> {
    if block.repeats {
        let time = |row| decided(study, column, row).map(|end| end.steps.min(horizon));
        return study.unit_mean(block, time);
    }
    // Any confidence works: only the mean is used.
    Some(curve(study, block, column)?.restricted_mean(horizon, 0.5)?.mean)
}

fn curve(study: &Study, block: &Block, column: &MetricColumn) -> Option<Survival> {
    Survival::of(&block.rows().filter_map(|row| ending(study, column, row)).collect::<Vec<_>>())
}

impl DurationRow {
    /// Every censored duration of the table, up to the last step at which every model's curve is known.
    pub(crate) fn all(study: &Study) -> Vec<Self> {
        let durations = study.relations.durations.iter().filter(|(duration, _)| is_duration(study, duration));
        let columns: Vec<&MetricColumn> = durations.filter_map(|(duration, _)| study.column(duration)).collect();
        let mut rows = Vec::new();
        for column in columns {
            for experiment in &study.experiments {
                let horizon = horizon_of(study, experiment, column);
                rows.extend(experiment.blocks.iter().map(|block| Self::of(study, block, column, horizon)));
            }
        }
        rows
    }

    fn of(study: &Study, block: &Block, column: &MetricColumn, horizon: Option<i64>) -> Self {
        let confidence = study.confidence;
        let endings: Vec<Ending> = block.rows().filter_map(|row| ending(study, column, row)).collect();
        let finished = endings.iter().filter(|ending| ending.outcome != Outcome::Unfinished).count() as u64;
        let n = endings.len() as u64;
        let curve = Survival::of(&endings);
        let restricted = curve.as_ref().zip(horizon).and_then(|(curve, at)| curve.restricted_mean(at, confidence));
        let (restricted, withheld) = restricted.map(|found| held(found, n, block.repeats)).unzip();
        let median_interval = curve.as_ref().and_then(|curve| curve.median_interval(confidence));
        Self {
            key: block.key(),
            metric: column.name.clone(),
            n,
            finished,
            mean: block.moments(column).mean(),
            median: curve.as_ref().and_then(Survival::median),
            median_interval: median_interval.filter(|_| n >= coverage::MEDIAN && !block.repeats),
            restricted,
            withheld: withheld.flatten(),
            correct: horizon.and_then(|at| CorrectRow::of(&endings, at, block.repeats, confidence)),
        }
    }
}

impl CorrectRow {
    fn of(endings: &[Ending], horizon: i64, repeats: bool, confidence: f64) -> Option<Self> {
        let curve = Incidence::of(endings)?;
        let (restricted, withheld) = held(curve.restricted_mean(horizon, confidence)?, curve.n(), repeats);
        let [correct, wrong] = curve.shares(horizon);
        Some(Self { correct, wrong, median: curve.median(), restricted, withheld })
    }
}

/// The mean with its interval, which takes episodes as independent: repeats of a unit are not.
fn held(found: RestrictedMean, n: u64, repeats: bool) -> (RestrictedMean, Option<Withheld>) {
    if repeats {
        return (RestrictedMean { interval: None, ..found }, Some(Withheld::Dependent));
    }
    let (interval, withheld): (Option<Interval>, _) =
        coverage::given(found.interval, n, coverage::RESTRICTED_MEAN, found.interval.is_some());
    (RestrictedMean { interval, ..found }, withheld)
}
