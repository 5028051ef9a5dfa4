//! Compares models over all experiments, with each experiment as a stratum.
//!
//! Rule: only experiments that both models have, recorded alike. If the two are paired in all of them, all pairs are
//! pooled; else every stratum is a 2x2 table of independent episodes.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::losses::{LossCase, LossCases, Toward, settle};
use crate::statistics::comparisons::matching::{Matched, Scenes, Sides, outcomes, selection};
use crate::statistics::comparisons::models::{Family, PairTest};
use crate::statistics::rates::durations::{decided, is_duration};
use crate::study::{Block, Study};
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::comparisons::holm::{is_significant, level};
use mirrorstats_statistics::comparisons::improvement::{Improvement, probability_of_improvement};
use mirrorstats_statistics::comparisons::margin::{Counts, Spread};
use mirrorstats_statistics::comparisons::stratified::{Stratum, common_difference, exact, pooled};
use mirrorstats_statistics::durations::competing::Outcome;
use mirrorstats_statistics::intervals::clustered::fewest_clusters;
use mirrorstats_statistics::intervals::interval::Interval;
use mirrorstats_statistics::outcomes::ExactTest;

/// The comparison of two rates over several experiments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OverallMethod {
    /// The exact conditional test over the experiments; the Mantel-Haenszel difference with Klingenberg's interval.
    #[default]
    MantelHaenszel,
    /// The exact test of `McNemar` over the pairs of all experiments; Newcombe's interval for pairs.
    PooledMcnemar,
    /// The exact permutation test over scenes, seeds or participants, each of which counts once over all experiments.
    Units,
}

/// Two models under one rate, over all experiments that both have.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OverallRow {
    /// The metric.
    pub metric: String,
    /// One model, the better one where they differ.
    pub first: String,
    /// The other.
    pub second: String,
    /// The experiments, each a stratum.
    pub experiments: Vec<String>,
    /// The test and the interval.
    pub method: OverallMethod,
    /// The first minus the second, as one difference for all strata.
    pub difference: Option<f64>,
    /// Its interval, not adjusted.
    pub interval: Option<Interval>,
    /// The exact p value, two-sided by minimum likelihood; none if there are too many episodes to enumerate.
    pub p: Option<f64>,
    /// The mid-p value, which is not guaranteed to keep the level.
    pub mid_p: Option<f64>,
    /// `p` adjusted by Holm's method over all pairs of models under the metric.
    pub p_adjusted: Option<f64>,
    /// True if the adjusted value reaches the level of significance.
    pub separated: bool,
    /// The experiments whose own difference points the other way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub opposite: Vec<String>,
    /// True if one of them shows its difference by itself: then there is no verdict over all.
    #[serde(default)]
    pub is_crossed: bool,
    /// The test with the lost episodes of both sides; none if none was lost.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub losses: Option<LossCases>,
}

/// The probability that one model decides earlier than another, averaged over the experiments that both have.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ImprovementRow {
    /// The metric, a duration: earlier is better, and an episode that never decides is later than all that do.
    pub metric: String,
    /// One model.
    pub first: String,
    /// The other.
    pub second: String,
    /// The experiments, each a stratum of the same weight.
    pub experiments: Vec<String>,
    /// The probability, ties counted half, with its stratified bootstrap interval.
    #[serde(flatten)]
    pub improvement: Improvement,
}

/// Two models' blocks, one pair per experiment.
struct Couple<'s, 'a> {
    first: String,
    second: String,
    strata: Vec<(&'s Block<'a>, &'s Block<'a>)>,
    /// The pairs of each stratum, if all strata have them.
    pairs: Option<Vec<Vec<(usize, usize)>>>,
}

impl<'s, 'a> Couple<'s, 'a> {
    fn all(study: &'s Study<'a>) -> Vec<Self> {
        let mut subjects: BTreeMap<String, BTreeMap<usize, &'s Block<'a>>> = BTreeMap::new();
        for (at, experiment) in study.experiments.iter().enumerate() {
            for block in &experiment.blocks {
                subjects.entry(block.name()).or_default().insert(at, block);
            }
        }
        let mut couples = Vec::new();
        for (at, (first, here)) in subjects.iter().enumerate() {
            for (second, there) in subjects.iter().skip(at + 1) {
                let both = here.iter().filter_map(|(experiment, &block)| Some((block, *there.get(experiment)?)));
                let strata: Vec<_> = both.filter(|(a, b)| study.incomparable(a, b).is_none()).collect();
                if strata.len() > 1 {
                    let scenes = |block| Scenes::of(study, block);
                    let pairs = strata.iter().map(|(a, b)| Matched::of(&scenes(a), &scenes(b)).pairs).collect();
                    couples.push(Self { first: first.clone(), second: second.clone(), strata, pairs });
                }
            }
        }
        couples
    }

    fn experiments(&self) -> Vec<String> {
        self.strata.iter().map(|(block, _)| block.experiment.to_owned()).collect()
    }

    fn rate(&self, study: &Study, column: &MetricColumn) -> OverallRow {
        let confidence = study.confidence;
        let is_selected = self.strata.iter().any(|(a, b)| selection(study, column, [a, b]).is_some());
        let sides = Sides::of(study, column, &self.strata);
        let of = |toward: Option<Toward>| {
            let row = self.by_episodes(column, toward, confidence);
            let Some(sides) = &sides else { return row };
            let few = level(confidence).is_none_or(|level| sides.len() < fewest_clusters(level));
            let lost = toward.map_or_else(Vec::new, |toward| toward.units(self.lost()));
            let test = sides.test(&lost);
            let p = test.filter(|_| !few).map(|test| test.p);
            let difference = test.map(|test| test.difference);
            let counts = sides.divided().filter(|_| p.is_some()).map(|units| Counts::of_units(&units));
            let interval = counts.and_then(|counts| counts.interval(confidence));
            OverallRow { method: OverallMethod::Units, difference, interval, p, mid_p: None, ..row }
        };
        let case = |row: &OverallRow| LossCase { difference: row.difference, p: row.p };
        let row = of(None);
        if is_selected {
            return OverallRow { interval: None, p: None, mid_p: None, ..row };
        }
        let losses = LossCases::of(self.lost(), |toward| case(&of(Some(toward)))).filter(|_| row.p.is_some());
        OverallRow { losses, ..row }
    }

    fn lost(&self) -> u64 {
        self.strata.iter().map(|(a, b)| a.lost + b.lost).sum()
    }

    fn by_episodes(&self, column: &MetricColumn, toward: Option<Toward>, confidence: f64) -> OverallRow {
        let row = |method, difference, interval, test: Option<ExactTest>| OverallRow {
            metric: column.name.clone(),
            first: self.first.clone(),
            second: self.second.clone(),
            experiments: self.experiments(),
            method,
            difference,
            interval,
            p: test.map(|test| test.p),
            mid_p: test.map(|test| test.mid_p),
            ..OverallRow::default()
        };
        if let Some(strata) = &self.pairs {
            let seen = pooled(&strata.iter().map(|rows| outcomes(column, rows)).collect::<Vec<_>>());
            let all = toward.map_or(seen, |toward| toward.pairs(seen, self.lost()));
            return row(OverallMethod::PooledMcnemar, all.difference(), all.interval(confidence), all.test());
        }
        let side = |block: &Block, is_first| Toward::assumed(toward, block, column, is_first).counts();
        let stratum = |(a, b): &(&Block, &Block)| Some(Stratum { first: side(a, true)?, second: side(b, false)? });
        let strata: Vec<Stratum> = self.strata.iter().filter_map(stratum).collect();
        let common = common_difference(&strata, confidence);
        row(
            OverallMethod::MantelHaenszel,
            common.map(|common| common.difference),
            common.and_then(|common| common.interval),
            common.and_then(|_| exact(&strata)),
        )
    }

    fn improvement(&self, study: &Study, column: &MetricColumn) -> Option<ImprovementRow> {
        // The statistic favours larger values, but earlier decisions are better: so the sides are swapped.
        let steps = |block: &Block| -> Vec<i64> {
            let endings = block.rows().filter_map(|row| decided(study, column, row));
            endings.map(|it| if it.outcome == Outcome::Unfinished { i64::MAX } else { it.steps }).collect()
        };
        let strata: Vec<(Vec<i64>, Vec<i64>)> = self.strata.iter().map(|(a, b)| (steps(b), steps(a))).collect();
        let strata: Vec<(&[i64], &[i64])> = strata.iter().map(|(b, a)| (b.as_slice(), a.as_slice())).collect();
        Some(ImprovementRow {
            metric: column.name.clone(),
            first: self.first.clone(),
            second: self.second.clone(),
            experiments: self.experiments(),
            improvement: probability_of_improvement(&strata, study.confidence)?,
        })
    }
}

pub(crate) fn rates(study: &Study, families: &[Family], metrics: &[String]) -> Vec<OverallRow> {
    let couples = Couple::all(study);
    let columns = metrics.iter().filter_map(|metric| study.column(metric));
    let of_rate = |column: &MetricColumn| {
        let mut rows: Vec<OverallRow> = couples.iter().map(|couple| couple.rate(study, column)).collect();
        adjust(&mut rows, study.confidence);
        rows.into_iter().map(|row| row.better_first(study).within(families, study.confidence)).collect::<Vec<_>>()
    };
    columns.filter(|column| study.is_rate(&column.name)).flat_map(of_rate).collect()
}

pub(crate) fn improvements(study: &Study, metrics: &[String]) -> Vec<ImprovementRow> {
    let couples = Couple::all(study);
    let columns = metrics.iter().filter_map(|metric| study.column(metric));
    let durations = columns.filter(|column| is_duration(study, &column.name));
    durations.flat_map(|column| couples.iter().filter_map(move |couple| couple.improvement(study, column))).collect()
}

fn adjust(rows: &mut [OverallRow], confidence: f64) {
    let seen = |row: &OverallRow| LossCase { difference: row.difference, p: row.p };
    let mut tested: Vec<&mut OverallRow> = rows.iter_mut().filter(|row| row.p.is_some()).collect();
    let settled = settle(tested.iter_mut().map(|row| (seen(row), &mut row.losses)), confidence);
    for (row, (p, is_shown)) in tested.into_iter().zip(settled) {
        (row.p_adjusted, row.separated) = (Some(p), is_shown);
    }
}

impl OverallRow {
    /// The smallest true difference that each of these tests would have shown with a probability of 0.8, at the first
    /// step of Holm's procedure, by the widths of their intervals.
    pub(crate) fn reach(rows: &[&Self], confidence: f64) -> Option<f64> {
        let level = level(confidence)? / rows.iter().filter(|row| row.p.is_some()).count().max(1) as f64;
        let reach = |interval| Spread::of_interval(0.0, interval, confidence, 1).detectable(level);
        rows.iter().filter_map(|row| row.interval.filter(|_| !row.separated)).map(reach).max_by(f64::total_cmp)
    }

    /// Withholds the verdict if one experiment alone shows the opposite: a qualitative interaction (Gail and Simon
    /// 1985), over which no difference is common to all. Both have the better model first.
    fn within(self, families: &[Family], confidence: f64) -> Self {
        let is_of = |family: &&Family| family.metric == self.metric && self.experiments.contains(&family.experiment);
        let is_turned = |test: &PairTest| {
            (&test.first, &test.second) == (&self.second, &self.first)
                && test.comparison.difference.is_some_and(|difference| difference.abs() > 0.0)
        };
        let turned = |family: &'_ Family| {
            Some((family.experiment.clone(), family.tests.iter().find(|it| is_turned(it))?.comparison.p))
        };
        let turned: Vec<(String, Option<f64>)> = families.iter().filter(is_of).filter_map(turned).collect();
        let is_crossed = turned.iter().filter_map(|(_, p)| *p).any(|p| is_significant(p, confidence));
        let opposite = turned.into_iter().map(|(experiment, _)| experiment).collect();
        Self { separated: self.separated && !is_crossed, opposite, is_crossed, ..self }
    }

    fn better_first(self, study: &Study) -> Self {
        if !study.is_worse(&self.metric, self.difference) {
            return self;
        }
        Self {
            first: self.second,
            second: self.first,
            difference: self.difference.map(|difference| -difference),
            interval: self.interval.map(Interval::negated),
            losses: self.losses.map(LossCases::turned),
            ..self
        }
    }
}
