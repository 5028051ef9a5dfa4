//! The episode table by experiment, model and condition: the blocks that every statistic compares.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::comparable::{Budget, PARTICIPANT, Recorded, SCENE, Varied, difference, driver};
use mirrorstats_exact::moments::{MomentOverflow, Moments};
use mirrorstats_metric::catalogs::catalog::{Better, Kind, Metric};
use mirrorstats_metric::catalogs::relations::Relations;
use mirrorstats_score::cells::interval::{self, CONFIDENCE};
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable, KeyRef, MetricColumn, TextColumn};
use mirrorstats_statistics::comparisons::units::mean;
use mirrorstats_statistics::design::{Cluster, Design};
use mirrorstats_statistics::intervals::interval::Interval;

const DEFAULT_CONDITION: &str = "default";

/// The unit of analysis: episodes within it depend on each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Unit {
    Seed(i32),
    Participant(usize),
    Scene(usize),
    Episode(usize),
}

/// An episode table and its blocks, ordered by the catalog's experiments, then by model and condition.
pub(crate) struct Study<'a> {
    pub table: &'a EpisodeTable,
    pub design: Design,
    pub experiments: Vec<Experiment<'a>>,
    pub relations: Relations,
    /// The confidence of every interval, and one minus the level of every test.
    pub confidence: f64,
    /// True to ignore differing settings.
    pub pool: bool,
    /// The margin of equivalence: of rates below 1, of durations from 1 on.
    pub margin: Option<f64>,
    ranges: BTreeMap<&'a str, Interval>,
}

/// The experiment, the model and the condition that a row is about.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct RowKey {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The condition, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
}

impl RowKey {
    /// The name in comparisons: `model`, or `model [condition]` if there are several.
    pub fn name(&self) -> String {
        named(&self.model, self.condition.as_deref())
    }
}

pub(crate) struct Experiment<'a> {
    pub name: &'a str,
    pub blocks: Vec<Block<'a>>,
}

/// The episodes of one model in one experiment under one condition, and the moments of their metrics.
pub(crate) struct Block<'a> {
    pub experiment: &'a str,
    pub model: &'a str,
    /// The condition; `None` if all episodes of the table have the default one.
    pub condition: Option<&'a str>,
    /// The side, if the table has several.
    pub side: Option<&'a str>,
    rows: Vec<Range<usize>>,
    recorded: Recorded<'a>,
    moments: BTreeMap<&'a str, Moments>,
    pub lost: u64,
    /// True if any unit has several episodes.
    pub repeats: bool,
}

impl<'a> Study<'a> {
    /// The blocks of a table; if its episodes have several sides, each side has blocks of its own.
    pub fn from_table(
        table: &'a EpisodeTable,
        design: Design,
        lost: Option<&LostCounts>,
        sides: Option<&'a TextColumn>,
    ) -> Result<Self, MomentOverflow> {
        let ranges = table.metrics.iter().map(|column| column.name.as_str()).zip(interval::ranges(table)).collect();
        let relations = Relations::of(&table.catalog);
        let (experiments, confidence, pool, margin) = (Vec::new(), CONFIDENCE, false, None);
        let mut study = Self { table, design, experiments, relations, confidence, pool, margin, ranges };
        let conditions = table.label(CONDITION).filter(|_| table.has_conditions());
        let mut blocks: BTreeMap<(usize, &str), Vec<Block>> = BTreeMap::new();
        // A table is ordered by experiment, then by model.
        for rows in runs(0..table.len(), |row| (table.keys.experiment.code(row), table.keys.model.code(row))) {
            let KeyRef { experiment, model, .. } = table.keys.get(rows.start);
            let of_experiment = blocks.entry((table.catalog.experiment_rank(experiment), experiment)).or_default();
            for ((condition, side), rows) in parts(conditions, sides, rows) {
                let lost = lost.map_or(0, |lost| lost.of(experiment, model, condition));
                of_experiment.push(study.block((experiment, model, condition), side, rows, lost)?);
            }
        }
        study.experiments = blocks.into_iter().map(|((_, name), blocks)| Experiment { name, blocks }).collect();
        Ok(study)
    }

    fn block(
        &self,
        (experiment, model, condition): (&'a str, &'a str, Option<&'a str>),
        side: Option<&'a str>,
        rows: Vec<Range<usize>>,
        lost: u64,
    ) -> Result<Block<'a>, MomentOverflow> {
        let of_column = |column: &'a MetricColumn| {
            let moments = rows.iter().try_fold(Moments::default(), |sum, rows| column.add_moments(sum, rows.clone()));
            Ok((column.name.as_str(), moments?))
        };
        let moments = self.table.metrics.iter().map(of_column).collect::<Result<_, _>>()?;
        let recorded = Recorded::of(self.table, rows.iter().cloned().flatten());
        let repeats = self.has_repeats(rows.iter().cloned().flatten());
        Ok(Block { experiment, model, condition, side, rows, recorded, moments, lost, repeats })
    }

    /// The differing setting of two blocks that the comparison does not vary; `None` if none is known.
    pub(crate) fn setting_between(&self, first: &Block, second: &Block, varied: Varied) -> Option<String> {
        difference(&self.table.declared, [&first.recorded, &second.recorded], varied)
    }

    /// The difference between the drivers of two models; `None` if none is known.
    pub(crate) fn driver_between(&self, first: &Block, second: &Block) -> Option<String> {
        driver(&self.table.declared, [&first.recorded, &second.recorded])
    }

    pub(crate) fn recorded_budget(&self, block: &Block) -> Budget {
        Budget::of(&self.table.declared, &block.recorded)
    }

    /// The same for two blocks of one study.
    pub(crate) fn setting_apart(&self, first: &Block, second: &Block) -> Option<String> {
        let varied = if first.experiment != second.experiment {
            Varied::Experiment
        } else if first.model == second.model {
            Varied::Condition
        } else {
            Varied::Model
        };
        self.setting_between(first, second, varied)
    }

    /// The same; `None` if differing settings are ignored.
    pub(crate) fn incomparable(&self, first: &Block, second: &Block) -> Option<String> {
        if self.pool { None } else { self.setting_apart(first, second) }
    }

    pub fn blocks(&self) -> impl Iterator<Item = &Block<'a>> {
        self.experiments.iter().flat_map(|experiment| &experiment.blocks)
    }

    /// The scene of each row, if equal scenes make pairs.
    pub fn scenes(&self) -> Option<&'a TextColumn> {
        self.table.label(SCENE).filter(|_| self.design.has_pairs())
    }

    /// Returns true if episodes may share a unit: clusters, participants or scenes are declared.
    pub(crate) fn has_units(&self) -> bool {
        let labelled = || [SCENE, PARTICIPANT].iter().any(|label| self.table.label(label).is_some());
        self.design.has_pairs() && (self.design.clusters().is_some() || labelled())
    }

    /// The unit of a row: the declared cluster, else the participant, else the scene, else the episode itself.
    pub fn unit(&self, row: usize) -> Unit {
        if self.design.clusters() == Some(Cluster::Seed) {
            return Unit::Seed(self.table.keys.seed(row));
        }
        let scene = || self.scenes().and_then(|scenes| scenes.code(row)).map(Unit::Scene);
        self.participant(row).map(Unit::Participant).or_else(scene).unwrap_or(Unit::Episode(row))
    }

    pub fn participant(&self, row: usize) -> Option<usize> {
        self.table.label(PARTICIPANT).filter(|_| self.design.has_pairs()).and_then(|label| label.code(row))
    }

    /// The defined values of each unit of a block.
    pub(crate) fn by_unit(&self, block: &Block, value: impl Fn(usize) -> Option<i64>) -> BTreeMap<Unit, Moments> {
        self.units_of(block.rows(), value)
    }

    /// The mean of a block as its tests take it: each unit counts once, however many episodes it has.
    pub(crate) fn mean(&self, block: &Block, column: &MetricColumn) -> Option<f64> {
        if !block.repeats {
            return block.moments(column).mean();
        }
        self.unit_mean(block, |row| column.get(row))
    }

    /// The mean over units of the means of their values.
    pub(crate) fn unit_mean(&self, block: &Block, value: impl Fn(usize) -> Option<i64>) -> Option<f64> {
        let units: Vec<Moments> = self.by_unit(block, value).into_values().collect();
        mean(&units)
    }

    pub(crate) fn units_of(
        &self,
        rows: impl Iterator<Item = usize>,
        value: impl Fn(usize) -> Option<i64>,
    ) -> BTreeMap<Unit, Moments> {
        let mut units: BTreeMap<Unit, Moments> = BTreeMap::new();
        for (row, value) in rows.filter_map(|row| Some((row, value(row)?))) {
            let sum = units.entry(self.unit(row)).or_default();
            *sum = sum.with(value).expect("a part of a block that was summed whole");
        }
        units
    }

    /// The first defined value of each unit, in the order of the episodes.
    pub fn firsts(&self, block: &Block, column: &MetricColumn) -> Vec<(Unit, i64)> {
        let mut seen = BTreeSet::new();
        let defined = block.rows().filter_map(|row| Some((self.unit(row), column.get(row)?)));
        defined.filter(|(unit, _)| seen.insert(*unit)).collect()
    }

    /// Returns true if a unit has several of these rows.
    pub(crate) fn has_repeats(&self, mut rows: impl Iterator<Item = usize>) -> bool {
        let mut units = BTreeSet::new();
        self.has_units() && !rows.all(|row| units.insert(self.unit(row)))
    }

    pub(crate) fn unit_name(&self, block: &Block) -> &'static str {
        self.name_of_unit(block.rows().next())
    }

    pub(crate) fn name_of_unit(&self, row: Option<usize>) -> &'static str {
        match row.map(|row| self.unit(row)) {
            Some(Unit::Seed(_)) => "seeds",
            Some(Unit::Participant(_)) => "participants",
            Some(Unit::Scene(_)) => "scenes",
            _ => "episodes",
        }
    }

    pub fn column(&self, metric: &str) -> Option<&'a MetricColumn> {
        self.table.metric(metric)
    }

    pub fn rates(&self) -> impl Iterator<Item = &'a MetricColumn> {
        self.table.metrics.iter().filter(|column| self.is_rate(&column.name))
    }

    /// The definition of a metric of the table.
    pub fn metric(&self, name: &str) -> &'a Metric {
        &self.table.catalog.metric[name]
    }

    pub fn is_rate(&self, metric: &str) -> bool {
        self.metric(metric).kind == Kind::Rate
    }

    /// Returns true if a difference under a metric favours the second side.
    pub fn is_worse(&self, metric: &str, difference: Option<f64>) -> bool {
        let is_lower = self.metric(metric).better == Better::Lower;
        difference.is_some_and(|difference| if is_lower { difference > 0.0 } else { difference < 0.0 })
    }

    /// The margin of equivalence under a metric; `None` if it is in the unit of others.
    pub(crate) fn margin_of(&self, column: &MetricColumn) -> Option<f64> {
        self.margin.filter(|margin| self.is_rate(&column.name) == (*margin < 1.0))
    }

    /// The least and the largest possible mean of a metric.
    pub fn range(&self, metric: &str) -> Interval {
        self.ranges.get(metric).copied().unwrap_or(Interval::UNBOUNDED)
    }
}

impl Block<'_> {
    /// The name in comparisons: `model`, or `model [condition]` if there are several.
    pub fn name(&self) -> String {
        named(self.model, self.condition)
    }

    /// Returns true if another block has the same model and condition.
    pub(crate) fn is_same_subject(&self, other: &Self) -> bool {
        (self.model, self.condition) == (other.model, other.condition)
    }

    pub fn key(&self) -> RowKey {
        RowKey { experiment: self.experiment.to_owned(), model: self.model.to_owned(), condition: self.condition() }
    }

    pub fn condition(&self) -> Option<String> {
        self.condition.map(str::to_owned)
    }

    pub fn rows(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        self.rows.iter().cloned().flatten()
    }

    pub fn moments(&self, column: &MetricColumn) -> Moments {
        self.moments[column.name.as_str()]
    }
}

pub(crate) fn named(model: &str, condition: Option<&str>) -> String {
    condition.map_or_else(|| model.to_owned(), |condition| format!("{model} [{condition}]"))
}

/// Every two of some items, in their order.
pub(crate) fn couples<T>(items: &[T]) -> impl Iterator<Item = (&T, &T)> {
    items.iter().enumerate().flat_map(|(at, first)| items[at + 1..].iter().map(move |second| (first, second)))
}

/// The condition and the side of a block.
type Part<'a> = (Option<&'a str>, Option<&'a str>);

/// The rows of one model by condition and side, which are not part of a table's order.
fn parts<'a>(
    conditions: Option<&'a TextColumn>,
    sides: Option<&'a TextColumn>,
    rows: Range<usize>,
) -> BTreeMap<Part<'a>, Vec<Range<usize>>> {
    let part = |row: usize| {
        let condition = conditions.map(|conditions| conditions.get(row).unwrap_or(DEFAULT_CONDITION));
        (condition, sides.and_then(|sides| sides.get(row)))
    };
    let mut parts = BTreeMap::<_, Vec<Range<usize>>>::new();
    for run in runs(rows, part) {
        parts.entry(part(run.start)).or_default().push(run);
    }
    parts
}

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
