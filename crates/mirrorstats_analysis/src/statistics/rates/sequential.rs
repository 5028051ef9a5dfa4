//! Statistics for a study in progress: confidence sequences and e-values.
//!
//! Rule: this module has no fixed-n statistics, so a reader may look after every episode and stop at any look. Families
//! are those of the fixed-n page: models of an experiment against a level, pairs of models of an experiment.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::matching::selection;
use crate::statistics::comparisons::models::by_mean;
use crate::statistics::conclusions::headline;
use crate::statistics::design_audit::{DesignAudit, Touched};
use crate::statistics::episodes::Selection;
use crate::statistics::options::Options;
use crate::statistics::rates::chance::{Level, Role, Verdict, levels};
use crate::study::{Block, Experiment, RowKey, Study, Unit, couples};
use mirrorstats_exact::moments::{MomentOverflow, Moments};
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_score::tables::table::{EpisodeTable, MetricColumn};
use mirrorstats_statistics::comparisons::holm::{holm, is_significant};
use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::intervals::interval::Interval;
use mirrorstats_statistics::sequential::{against_level, confidence_sequence, discordant};

/// Statistics that hold at every look and at any stop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sequential {
    /// The definition file's own name.
    pub definitions: String,
    /// SHA-256 of the resolved definitions.
    pub definitions_hash: String,
    /// The confidence of every sequence, and one minus the level of every verdict.
    pub confidence: f64,
    /// The number of episodes so far.
    pub episodes: usize,
    /// The filter that chose the episodes; null without one.
    #[serde(default, rename = "where")]
    pub selection: Option<Selection>,
    /// The departures from the registered plan; null without a plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub departures: Option<Vec<String>>,
    /// Settings that differ within a cell or between models that are compared, and were declared not to matter.
    #[serde(default)]
    pub pooled: Vec<String>,
    /// The settings that keep models from being compared, each with the number of pairs.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub not_comparable: BTreeMap<String, usize>,
    /// The design audit, as of the statistics at a fixed number of episodes.
    #[serde(default)]
    pub audit: DesignAudit,
    /// The caveats of every verdict: the filter, pooling, and the findings of the audit about levels and models.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub caveats: Vec<String>,
    /// The rates that have a level to be compared with.
    pub headline: Vec<String>,
    /// Every rate of every model.
    pub rates: Vec<SequentialRate>,
    /// Rates against chance and reference levels.
    pub chance: Vec<SequentialChance>,
    /// Models against each other.
    pub models: Vec<SequentialPair>,
}

/// One rate of one model in one experiment; of scenes, seeds or participants with several episodes, the first of each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SequentialRate {
    #[serde(flatten)]
    pub key: RowKey,
    /// The metric.
    pub metric: String,
    /// The successes.
    pub successes: u64,
    /// The episodes in which the metric is defined.
    pub n: u64,
    /// The rate; none without an episode.
    pub rate: Option<f64>,
    /// Its confidence sequence at this n.
    pub interval: Option<Interval>,
}

/// One rate against one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SequentialChance {
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
    /// The e-value.
    pub e: f64,
    /// The anytime-valid p value, 1 / e.
    pub p: f64,
    /// The same adjusted by Holm's method over the models of the experiment, against this level.
    pub p_adjusted: f64,
    /// The verdict of the adjusted value at the level of significance.
    pub verdict: Verdict,
}

/// One model against another, over pairs: of equal scenes, and of the others in the order of seed and run.
///
/// Each scene, seed or participant enters once, by its first episode. Which episodes are a pair does not depend on any
/// outcome, so that of a discordant pair either side succeeds with the same chance if the models do not differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SequentialPair {
    /// The experiment.
    pub experiment: String,
    /// The metric.
    pub metric: String,
    /// The model with the better mean.
    pub first: String,
    /// The other one.
    pub second: String,
    /// The 2x2 table of the pairs.
    pub pairs: Pairs,
    /// The pairs of equal scenes, seeds or participants among them.
    #[serde(default)]
    pub shared: u64,
    /// The e-value of the discordant pairs.
    pub e: f64,
    /// The anytime-valid p value, 1 / e.
    pub p: f64,
    /// The same adjusted by Holm's method over all pairs of models in the experiment.
    pub p_adjusted: f64,
    /// The position of the first model's rate relative to the second's.
    pub verdict: Verdict,
}

impl Sequential {
    /// The statistics of `table`, the episodes so far. For a confidence outside (0, 1), sequences and verdicts are
    /// undefined.
    pub fn from_table(table: &EpisodeTable, options: &Options) -> Result<Self, MomentOverflow> {
        let mut study = Study::from_table(table, options.design, None, None)?;
        (study.confidence, study.pool) = (options.confidence, options.pooled.is_some());
        let rates = SequentialRate::all(&study);
        let audit = DesignAudit::of(&study, options);
        let pooled = options.pooled_in(&study);
        let mut caveats = audit.caveats(Touched::Levels, options, !pooled.is_empty());
        let of_models = audit.phrases(Touched::Models).filter(|phrase| !caveats.contains(phrase)).cloned();
        caveats.extend(of_models.collect::<Vec<_>>());
        Ok(Self {
            definitions: table.catalog.name.clone(),
            definitions_hash: table.catalog.hash.clone(),
            confidence: options.confidence,
            episodes: table.len(),
            selection: options.selection.clone(),
            departures: None,
            pooled,
            not_comparable: not_comparable(&study),
            audit,
            caveats,
            headline: headline_rates(&study),
            chance: SequentialChance::all(&study, &rates),
            models: SequentialPair::all(&study),
            rates,
        })
    }
}

fn not_comparable(study: &Study) -> BTreeMap<String, usize> {
    let mut found = BTreeMap::new();
    for (first, second) in study.experiments.iter().flat_map(|experiment| couples(&experiment.blocks)) {
        if let Some(setting) = study.incomparable(first, second) {
            *found.entry(setting).or_default() += 1;
        }
    }
    found
}

fn headline_rates(study: &Study) -> Vec<String> {
    let chosen: Vec<String> = headline(study).into_iter().filter(|metric| study.is_rate(metric)).collect();
    if chosen.is_empty() { study.rates().take(1).map(|column| column.name.clone()).collect() } else { chosen }
}

impl SequentialRate {
    /// The rates with values 0 or 1 in every episode, by experiment, then by metric and model.
    fn all(study: &Study) -> Vec<Self> {
        let mut rows = Vec::new();
        for experiment in &study.experiments {
            for column in study.rates() {
                rows.extend(experiment.blocks.iter().filter_map(|block| Self::of(study, block, column)));
            }
        }
        rows
    }

    fn of(study: &Study, block: &Block, column: &MetricColumn) -> Option<Self> {
        let mut firsts = study.firsts(block, column).into_iter();
        let moments = firsts.try_fold(Moments::default(), |sum, (_, value)| sum.with(value)).ok()?;
        let (successes, n) = moments.counts()?;
        Some(Self {
            key: block.key(),
            metric: column.name.clone(),
            successes,
            n,
            rate: moments.mean(),
            interval: confidence_sequence(successes, n, study.confidence),
        })
    }
}

impl SequentialChance {
    fn all(study: &Study, rates: &[SequentialRate]) -> Vec<Self> {
        let is_same =
            |a: &SequentialRate, b: &SequentialRate| a.key.experiment == b.key.experiment && a.metric == b.metric;
        let families = rates.chunk_by(is_same).flat_map(|rates| {
            let levels = levels(study, &rates[0].key.experiment, &rates[0].metric);
            levels.into_iter().map(move |level| Self::family(rates, &level, study.confidence))
        });
        families.flatten().collect()
    }

    fn family(rates: &[SequentialRate], level: &Level, confidence: f64) -> Vec<Self> {
        let chance = level.rate;
        let evidence = |rate: &SequentialRate| Some((rate.clone(), against_level(rate.successes, rate.n, chance)?));
        let tested: Vec<_> = rates.iter().filter_map(evidence).collect();
        let adjusted = holm(&tested.iter().map(|(_, found)| found.p).collect::<Vec<_>>());
        let rows = tested.into_iter().zip(adjusted).map(|((rate, found), p_adjusted)| Self {
            verdict: Verdict::by_order(
                rate.rate.unwrap_or_default().total_cmp(&chance.value()),
                is_significant(p_adjusted, confidence),
            ),
            key: rate.key,
            metric: rate.metric,
            role: level.role,
            level: chance,
            strategy: level.strategy.clone(),
            successes: rate.successes,
            n: rate.n,
            e: found.e,
            p: found.p,
            p_adjusted,
        });
        rows.collect()
    }
}

impl SequentialPair {
    fn all(study: &Study) -> Vec<Self> {
        let families = study.experiments.iter().flat_map(|experiment| study.rates().map(move |it| (experiment, it)));
        families.flat_map(|(experiment, column)| Self::family(study, experiment, column)).collect()
    }

    fn family(study: &Study, experiment: &Experiment, column: &MetricColumn) -> Vec<Self> {
        let mut blocks: Vec<&Block> = experiment.blocks.iter().collect();
        // The same episodes as the pairs: the first of each unit.
        let mean = |block: &Block| {
            let firsts = study.firsts(block, column);
            let sum: i64 = firsts.iter().map(|(_, value)| *value).sum();
            (!firsts.is_empty()).then(|| sum as f64 / firsts.len() as f64)
        };
        blocks.sort_by(|a, b| by_mean(mean(a), mean(b), study.metric(&column.name).better));
        let firsts: Vec<_> = blocks.iter().map(|block| (*block, study.firsts(block, column))).collect();
        let mut tested = Vec::new();
        for ((first, here), (second, there)) in couples(&firsts) {
            let is_selected = selection(study, column, [first, second]).is_some();
            if !is_selected && study.incomparable(first, second).is_none() {
                let (pairs, shared) = matched(here, there);
                tested.extend(discordant(pairs).map(|found| (first, second, pairs, shared, found)));
            }
        }
        let adjusted = holm(&tested.iter().map(|(.., found)| found.p).collect::<Vec<_>>());
        let rows = tested.into_iter().zip(adjusted).map(|((first, second, pairs, shared, found), p_adjusted)| Self {
            experiment: experiment.name.to_owned(),
            metric: column.name.clone(),
            first: first.name(),
            second: second.name(),
            pairs,
            shared,
            e: found.e,
            p: found.p,
            p_adjusted,
            verdict: Verdict::by_order(
                pairs.first_only.cmp(&pairs.second_only),
                is_significant(p_adjusted, study.confidence),
            ),
        });
        rows.collect()
    }
}

/// Pairs of equal units, then pairs of the others in order; and the number of pairs of equal units.
fn matched(first: &[(Unit, i64)], second: &[(Unit, i64)]) -> (Pairs, u64) {
    let of_second: BTreeMap<Unit, i64> = second.iter().copied().collect();
    let shared: BTreeMap<Unit, (i64, i64)> =
        first.iter().filter_map(|&(unit, value)| Some((unit, (value, *of_second.get(&unit)?)))).collect();
    let alone = |side: &[(Unit, i64)]| -> Vec<i64> {
        side.iter().filter(|(unit, _)| !shared.contains_key(unit)).map(|(_, value)| *value).collect()
    };
    let rest = alone(first).into_iter().zip(alone(second));
    (Pairs::of(shared.values().copied().chain(rest)), shared.len() as u64)
}
