//! The episode table seen by experiment, model and condition: the blocks that every statistic compares.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::metric::catalog::{Better, Kind, Metric, PPM};
use crate::score::table::{CONDITION, EpisodeTable, MetricColumn, TextColumn};
use crate::stats::design::Design;
use crate::stats::moments::{MomentOverflow, Moments};

/// Which metrics are durations that end with a decision, and which metric is defined where there was one, 1 where that
/// was correct.
///
/// The one place where statistics know a metric by name: a definition file does not say that a quantity is censored.
pub const CENSORED: [(&str, &str); 1] = [("TTD", "TSA-C")];

/// What stands for no condition.
const DEFAULT_CONDITION: &str = "default";

/// The label of the scene: room, body, cubes, start.
const SCENE: &str = "scene";

/// The unit of metrics that count steps.
const STEPS: &str = "steps";

/// An episode table and its blocks, ordered by the catalog's experiments, then by model and condition.
pub(super) struct Study<'a> {
    pub table: &'a EpisodeTable,
    pub design: Design,
    pub experiments: Vec<Experiment<'a>>,
    ranges: BTreeMap<&'a str, (f64, f64)>,
}

/// The blocks of one experiment.
pub(super) struct Experiment<'a> {
    pub name: &'a str,
    pub blocks: Vec<Block<'a>>,
}

/// The episodes of one model in one experiment under one condition, and the moments of their metrics.
pub(super) struct Block<'a> {
    pub experiment: &'a str,
    pub model: &'a str,
    /// The condition; none where no episode of the table has any but the default one.
    pub condition: Option<&'a str>,
    /// The rows of the table, in runs.
    rows: Vec<Range<usize>>,
    moments: BTreeMap<&'a str, Moments>,
}

impl<'a> Study<'a> {
    pub fn of(table: &'a EpisodeTable, design: Design) -> Result<Self, MomentOverflow> {
        let conditions = table.label(CONDITION).filter(|_| table.has_conditions());
        let mut blocks: BTreeMap<(usize, &str), Vec<Block>> = BTreeMap::new();
        // A table is ordered by experiment, then by model.
        for rows in runs(0..table.len(), |row| (table.keys.experiments().code(row), table.keys.models().code(row))) {
            let key = table.keys.get(rows.start);
            let of_experiment =
                blocks.entry((table.catalog.experiment_rank(key.experiment), key.experiment)).or_default();
            for (condition, rows) in by_condition(conditions, rows) {
                of_experiment.push(Block::of(table, (key.experiment, key.model, condition), rows)?);
            }
        }
        let experiments = blocks.into_iter().map(|((_, name), blocks)| Experiment { name, blocks }).collect();
        Ok(Self { table, design, experiments, ranges: ranges(table) })
    }

    pub fn blocks(&self) -> impl Iterator<Item = &Block<'a>> {
        self.experiments.iter().flat_map(|experiment| &experiment.blocks)
    }

    /// The scene of each row, where equal scenes make pairs.
    pub fn scenes(&self) -> Option<&'a TextColumn> {
        self.table.label(SCENE).filter(|_| self.design.has_pairs())
    }

    pub fn column(&self, metric: &str) -> Option<&'a MetricColumn> {
        self.table.metric(metric)
    }

    /// The metrics of 0 and 1.
    pub fn rates(&self) -> impl Iterator<Item = &'a MetricColumn> {
        self.table.metrics.iter().filter(|column| self.kind(&column.name) == Kind::Rate)
    }

    /// What a metric's integers mean; a metric that the catalog does not describe is no rate.
    pub fn kind(&self, metric: &str) -> Kind {
        self.metric(metric).map_or(Kind::Quantity, |metric| metric.kind)
    }

    pub fn metric(&self, name: &str) -> Option<&'a Metric> {
        self.table.catalog.metric.get(name)
    }

    /// Whether a larger mean comes first.
    pub fn better(&self, metric: &str) -> Better {
        self.metric(metric).map_or(Better::Neither, |metric| metric.better)
    }

    /// The least and the largest mean that a metric can have, as far as that is known: steps are never negative, and
    /// no more than the longest episode that ended without a decision had, which is the budget.
    pub fn range(&self, metric: &str) -> (f64, f64) {
        self.ranges.get(metric).copied().unwrap_or((f64::NEG_INFINITY, f64::INFINITY))
    }
}

/// The [`Study::range`] of each metric of a table; each takes a pass over all episodes.
#[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
fn ranges(table: &EpisodeTable) -> BTreeMap<&str, (f64, f64)> {
    let longest = CENSORED.iter().filter_map(|(duration, finished)| {
        let (duration, finished) = (table.metric(duration)?, table.metric(finished)?);
        let unfinished = duration.iter().zip(finished.iter()).filter(|(_, finished)| finished.is_none());
        unfinished.filter_map(|(steps, _)| steps).max()
    });
    let longest = longest.max();
    let range = |column: &MetricColumn| match table.catalog.metric.get(&column.name) {
        Some(metric) if metric.unit == PPM => (f64::NEG_INFINITY, 1e6),
        Some(metric) if metric.kind != Kind::Rate && metric.unit == STEPS => {
            let most = column.iter().flatten().max();
            // A metric that exceeds it counts something else than the steps of one episode.
            let budget = longest.filter(|&budget| most.is_none_or(|most| most <= budget));
            (0.0, budget.map_or(f64::INFINITY, |budget| budget as f64))
        }
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    };
    table.metrics.iter().map(|column| (column.name.as_str(), range(column))).collect()
}

impl<'a> Block<'a> {
    fn of(
        table: &'a EpisodeTable,
        (experiment, model, condition): (&'a str, &'a str, Option<&'a str>),
        rows: Vec<Range<usize>>,
    ) -> Result<Self, MomentOverflow> {
        let of_column = |column: &'a MetricColumn| {
            let moments = rows.iter().try_fold(Moments::default(), |sum, rows| sum.with_rows(column, rows.clone()))?;
            Ok((column.name.as_str(), moments))
        };
        let moments = table.metrics.iter().map(of_column).collect::<Result<_, _>>()?;
        Ok(Self { experiment, model, condition, rows, moments })
    }

    /// The model as it is compared: `model`, or `model [condition]` where there are several.
    pub fn name(&self) -> String {
        named(self.model, self.condition)
    }

    /// Whether another block is of the same model under the same condition.
    pub fn is_same_subject(&self, other: &Self) -> bool {
        (self.model, self.condition) == (other.model, other.condition)
    }

    /// The condition as rows have it.
    pub fn condition(&self) -> Option<String> {
        self.condition.map(str::to_owned)
    }

    /// The rows of the table.
    pub fn rows(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.rows.iter().cloned().flatten()
    }

    /// The exact moments of a metric of the table.
    pub fn moments(&self, column: &MetricColumn) -> Moments {
        self.moments[column.name.as_str()]
    }

    /// The rows of each seed.
    pub fn seeds(&self, table: &EpisodeTable) -> Vec<Vec<usize>> {
        let mut seeds: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
        for row in self.rows() {
            seeds.entry(table.keys.seed(row)).or_default().push(row);
        }
        seeds.into_values().collect()
    }
}

/// A model under a condition.
pub(super) fn named(model: &str, condition: Option<&str>) -> String {
    condition.map_or_else(|| model.to_owned(), |condition| format!("{model} [{condition}]"))
}

/// The rows of one model by condition, which is not part of a table's order.
fn by_condition(conditions: Option<&TextColumn>, rows: Range<usize>) -> Vec<(Option<&str>, Vec<Range<usize>>)> {
    let Some(conditions) = conditions else { return vec![(None, vec![rows])] };
    let mut parts: BTreeMap<&str, Vec<Range<usize>>> = BTreeMap::new();
    for run in runs(rows, |row| conditions.get(row).unwrap_or(DEFAULT_CONDITION)) {
        parts.entry(conditions.get(run.start).unwrap_or(DEFAULT_CONDITION)).or_default().push(run);
    }
    parts.into_iter().map(|(condition, rows)| (Some(condition), rows)).collect()
}

/// The runs of rows that have the same key.
fn runs<K: PartialEq>(rows: Range<usize>, key: impl Fn(usize) -> K) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for row in rows {
        match runs.last_mut() {
            Some(run) if key(run.start) == key(row) => run.end = row + 1,
            _ => runs.push(row..row + 1),
        }
    }
    runs
}

/// The successes of a rate and its episodes, where every value is 0 or 1.
pub(super) fn counts(moments: &Moments) -> Option<(u64, u64)> {
    let successes = u64::try_from(moments.sum).ok()?;
    (successes <= moments.n && moments.sum == moments.sum_sq).then_some((successes, moments.n))
}
