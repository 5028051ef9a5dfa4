//! Rates against the levels of blind guessing, by the exact binomial test.
//!
//! Rule: a rate that counts unfinished episodes as failures is beside the same rate among finished episodes
//! ([`Relations`](mirrorstats_metric::catalogs::relations::Relations)): a model that never finishes is below chance, but need not guess.

use std::cmp::Ordering;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::losses::{LossCase, LossCases, Toward, settle};
use crate::statistics::comparisons::matching::{Units, too_few};
use crate::study::{Block, Experiment, RowKey, Study};
use mirrorstats_exact::chance::with_strategy;
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::chance::{exact_test, least_p};
use mirrorstats_statistics::comparisons::holm::level;
use mirrorstats_statistics::comparisons::units::{mean, rate_test};
use mirrorstats_statistics::power::POWER;
use mirrorstats_statistics::sample_size::{OneRate, Power as _, smallest};

/// One rate against one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChanceRow {
    #[serde(flatten)]
    pub key: RowKey,
    /// The metric.
    pub metric: String,
    /// The role of the level.
    pub role: Role,
    /// The level.
    pub level: Ratio,
    /// The blind strategy that reaches the level, where the experiment declares several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strategy: Option<String>,
    /// The successes.
    pub successes: u64,
    /// The episodes in which the metric is defined.
    pub n: u64,
    /// The mean over units, each counted once, as in the test; null if each episode is its own unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_mean: Option<f64>,
    /// The exact p value, two-sided by minimum likelihood.
    pub p: f64,
    /// The mid-p value, which is not guaranteed to keep the level.
    pub mid_p: f64,
    /// `p` adjusted by Holm's method over the models of the experiment, against this level.
    pub p_adjusted: f64,
    /// The verdict of the Holm-adjusted value at the level of significance.
    pub verdict: Verdict,
    /// The units of analysis where some have several episodes: the test counts each once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<Units>,
    /// The test with the lost episodes of the model; none if it lost none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub losses: Option<LossCases>,
}

/// The role of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The rate of blind guessing.
    Chance,
    /// The result of some blind strategy, where no chance level applies.
    Reference,
}

mirrorstats_exact::names!(Role { Chance: "chance", Reference: "reference" });

/// The position of a rate relative to a level.
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
    pub(crate) fn all(study: &Study) -> Vec<Self> {
        let mut rows = Vec::new();
        for experiment in &study.experiments {
            for column in study.rates() {
                for level in levels(study, experiment.name, &column.name) {
                    rows.extend(Self::family(study, experiment, column, &level));
                }
            }
        }
        rows
    }

    fn family(study: &Study, experiment: &Experiment, column: &MetricColumn, level: &Level) -> Vec<Self> {
        let of = |block: &Block| Self::of(study, block, column, level);
        let (seen, mut rows): (Vec<LossCase>, Vec<Self>) = experiment.blocks.iter().filter_map(of).unzip();
        let settled = settle(seen.into_iter().zip(rows.iter_mut().map(|row| &mut row.losses)), study.confidence);
        for (row, (p_adjusted, is_shown)) in rows.iter_mut().zip(settled) {
            row.p_adjusted = p_adjusted;
            let order = row.estimate().total_cmp(&row.level.value());
            row.verdict = Verdict::by_order(order, is_shown && !row.counted(study.confidence).too_few);
        }
        rows
    }

    /// One rate of one block, before adjustment.
    fn of(study: &Study, block: &Block, column: &MetricColumn, level: &Level) -> Option<(LossCase, Self)> {
        let chance = level.rate;
        let (successes, n) = block.moments(column).counts()?;
        let of_units: Option<Vec<Moments>> =
            block.repeats.then(|| study.by_unit(block, |row| column.get(row)).into_values().collect());
        let tested = |toward: Option<Toward>| {
            let Some(units) = &of_units else {
                let moments = Toward::assumed(toward, block, column, true);
                let (successes, n) = moments.counts()?;
                return Some((moments.mean().unwrap_or(0.0), exact_test(successes, n, chance)?, least_p(n, chance)?));
            };
            let lost = toward.map_or_else(Vec::new, |toward| toward.units(block.lost));
            let units: Vec<Moments> = units.iter().copied().chain(lost.into_iter().map(|(one, _)| one)).collect();
            let (test, least) = rate_test(&units, chance)?;
            Some((mean(&units)?, test, least))
        };
        let case = |toward| {
            let found = tested(toward);
            let difference = found.map(|(mean, ..)| mean - chance.value());
            LossCase { difference, p: found.map(|(_, test, _)| test.p) }
        };
        let (estimate, test, least) = tested(None)?;
        let units = of_units.as_ref().map(|units| Units::new(study, block, units.len(), least));
        let row = Self {
            key: block.key(),
            metric: column.name.clone(),
            role: level.role,
            level: chance,
            strategy: level.strategy.clone(),
            successes,
            n,
            unit_mean: units.as_ref().map(|_| estimate),
            p: test.p,
            mid_p: test.mid_p,
            p_adjusted: test.p,
            verdict: Verdict::NotSeparated,
            units,
            losses: LossCases::of(block.lost, |toward| case(Some(toward))),
        };
        Some((case(None), row))
    }

    /// The rate that is compared with the level.
    fn estimate(&self) -> f64 {
        self.unit_mean.unwrap_or(self.successes as f64 / self.n as f64)
    }

    /// `chance (1/3)`, `the reference (0.5)`.
    pub fn against(&self) -> String {
        let role = if self.role == Role::Chance { "chance" } else { "the reference" };
        format!("{role} ({})", with_strategy(self.level, self.strategy.as_deref()))
    }

    /// The units of the test: scenes, seeds or participants, else episodes.
    fn counted(&self, confidence: f64) -> Units {
        self.units.clone().unwrap_or_else(|| {
            let least = least_p(self.n, self.level);
            let n = usize::try_from(self.n).unwrap_or(usize::MAX);
            let too_few = least.is_none_or(|least| too_few(n, least, confidence));
            Units { n: self.n, name: "episodes".to_owned(), too_few }
        })
    }

    /// The units or episodes that are too few for a verdict, or the lost ones that decide it; otherwise `None`.
    pub(crate) fn unsaid(&self, confidence: f64) -> Option<Units> {
        let units = self.counted(confidence);
        units.too_few.then_some(units).or_else(|| LossCases::unsettled(self.losses.as_ref()))
    }

    /// The smallest rate above the level that each of these rows would have shown with a probability of 0.8, at the first
    /// step of Holm's procedure.
    pub(crate) fn reach(family: &[&Self], confidence: f64) -> Option<f64> {
        let first_step = level(confidence)? / family.len() as f64;
        let said = family.iter().filter(|row| row.unsaid(confidence).is_none());
        let (n, chance) = said.map(|row| (row.counted(confidence).n, row.level)).min_by_key(|it| it.0)?;
        let power = |above| OneRate { level: first_step, chance, rate: chance.value() + above }.power(n);
        Some(chance.value() + smallest(POWER, 1.0 - chance.value(), power)?)
    }

    /// The largest number of units or episodes, if no outcome of these models could pass Holm's first step.
    pub(crate) fn hopeless(family: &[&Self], confidence: f64) -> Option<Units> {
        let first_step = level(confidence)? / family.len() as f64;
        let is_hopeless =
            |row: &&Self| least_p(row.counted(confidence).n, row.level).is_none_or(|least| least > first_step);
        let most = family.iter().map(|row| row.counted(confidence)).max_by_key(|units| units.n)?;
        family.iter().all(is_hopeless).then_some(most)
    }
}

mirrorstats_exact::names!(Verdict { Above: "above", Below: "below", NotSeparated: "not told apart" });

impl Verdict {
    pub(crate) fn by_order(order: Ordering, is_shown: bool) -> Self {
        match order {
            Ordering::Greater if is_shown => Self::Above,
            Ordering::Less if is_shown => Self::Below,
            _ => Self::NotSeparated,
        }
    }
}

/// A level of an experiment's metric.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    pub role: Role,
    pub rate: Ratio,
    pub strategy: Option<String>,
}

pub(crate) fn levels(study: &Study, experiment: &str, metric: &str) -> Vec<Level> {
    let own = own_levels(study, experiment, metric);
    match study.relations.whole(metric) {
        Some(whole) if own.is_empty() => own_levels(study, experiment, whole),
        _ => own,
    }
}

pub(crate) fn own_levels(study: &Study, experiment: &str, metric: &str) -> Vec<Level> {
    let catalog = &study.table.catalog;
    let chance = catalog.levels(experiment, metric).pop();
    let chance = chance.map(|(strategy, level)| Level { role: Role::Chance, rate: level, strategy });
    let references = catalog.experiment.get(experiment).and_then(|known| known.reference.get(metric));
    let references =
        references.into_iter().flatten().map(|&level| Level { role: Role::Reference, rate: level, strategy: None });
    chance.into_iter().chain(references).collect()
}
