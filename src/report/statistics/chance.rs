//! Rates against the levels of blind guessing, by the exact binomial test.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Experiment, Study, counts};
use crate::base::ratio::Ratio;
use crate::stats::chance::two_sided;
use crate::stats::holm::{holm, level};

/// One rate against one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChanceRow {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The metric.
    pub metric: String,
    /// What the level is.
    pub role: Role,
    /// The level.
    pub level: Ratio,
    /// The successes.
    pub successes: u64,
    /// The episodes in which the metric is defined.
    pub n: u64,
    /// The exact two-sided p value.
    pub p: f64,
    /// The same adjusted by Holm's method over the models of the experiment, against this level.
    pub p_adjusted: f64,
    /// What the adjusted value says at the level of significance.
    pub verdict: Verdict,
}

/// What a level stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The rate of blind guessing.
    Chance,
    /// What some blind strategy would reach, where no chance level applies.
    Reference,
}

/// Where a rate stands against a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Shown to be above.
    Above,
    /// Shown to be below.
    Below,
    /// Not shown to differ.
    NotSeparated,
}

impl ChanceRow {
    /// Every rate against every level that its experiment has.
    pub(super) fn all(study: &Study, confidence: f64) -> Vec<Self> {
        let mut rows = Vec::new();
        for experiment in &study.experiments {
            for column in study.rates() {
                for (role, level) in levels(study, experiment.name, &column.name) {
                    rows.extend(Self::family(study, experiment, &column.name, (role, level), confidence));
                }
            }
        }
        rows
    }

    fn family(
        study: &Study,
        experiment: &Experiment,
        metric: &str,
        (role, chance): (Role, Ratio),
        confidence: f64,
    ) -> Vec<Self> {
        let Some(column) = study.column(metric) else { return Vec::new() };
        let tested: Vec<_> = experiment
            .blocks
            .iter()
            .filter_map(|block| {
                let (successes, n) = counts(&block.moments(column))?;
                two_sided(successes, n, chance).map(|p| (block.model, successes, n, p))
            })
            .collect();
        let adjusted = holm(&tested.iter().map(|&(.., p)| p).collect::<Vec<_>>());
        let row = |((model, successes, n, p), p_adjusted): ((&str, u64, u64, f64), f64)| Self {
            experiment: experiment.name.to_owned(),
            model: model.to_owned(),
            metric: metric.to_owned(),
            role,
            level: chance,
            successes,
            n,
            p,
            p_adjusted,
            verdict: Verdict::of(successes, n, chance, level(confidence).is_some_and(|level| p_adjusted <= level)),
        };
        tested.into_iter().zip(adjusted).map(row).collect()
    }
}

impl Verdict {
    pub(super) fn of(successes: u64, n: u64, level: Ratio, is_shown: bool) -> Self {
        let seen = i128::from(successes) * i128::from(level.denominator());
        let expected = i128::from(level.numerator()) * i128::from(n);
        match is_shown {
            true if seen > expected => Self::Above,
            true if seen < expected => Self::Below,
            _ => Self::NotSeparated,
        }
    }
}

/// The levels of a metric in an experiment: chance, then references.
pub(super) fn levels(study: &Study, experiment: &str, metric: &str) -> Vec<(Role, Ratio)> {
    let catalog = &study.table.catalog;
    let chance = catalog.chance(experiment, metric).map(|level| (Role::Chance, level));
    let references = catalog.experiment.get(experiment).and_then(|known| known.reference.get(metric));
    let references = references.into_iter().flatten().map(|&level| (Role::Reference, level));
    chance.into_iter().chain(references).collect()
}
