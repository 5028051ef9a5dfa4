//! The episode table seen by experiment and model: the blocks that every statistic compares.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::metric::catalog::{Better, Kind, Metric};
use crate::score::table::{EpisodeTable, MetricColumn};
use crate::stats::moments::{MomentOverflow, Moments};

/// An episode table and its blocks, ordered by the catalog's experiments, then by model.
pub(super) struct Study<'a> {
    pub table: &'a EpisodeTable,
    pub experiments: Vec<Experiment<'a>>,
}

/// The blocks of one experiment.
pub(super) struct Experiment<'a> {
    pub name: &'a str,
    pub blocks: Vec<Block<'a>>,
}

/// The episodes of one model in one experiment, as rows of the table, and the moments of their metrics.
pub(super) struct Block<'a> {
    pub experiment: &'a str,
    pub model: &'a str,
    pub rows: Range<usize>,
    moments: BTreeMap<&'a str, Moments>,
}

/// Where an episode stands in its block: what pairs it with another model's.
pub(super) type Place = (i32, i32);

/// The seeds and runs of an experiment's episodes.
pub(super) struct Places {
    /// The seeds and runs that some block has, ascending.
    pub all: Vec<Place>,
    /// Per block and place the rows of its episodes: one, none, or several where the same seed and run was recorded again.
    pub rows: Vec<Vec<Range<usize>>>,
}

impl<'a> Study<'a> {
    pub fn of(table: &'a EpisodeTable) -> Result<Self, MomentOverflow> {
        // A table is ordered by experiment, then by model.
        let mut rows: BTreeMap<(usize, &str), Vec<Range<usize>>> = BTreeMap::new();
        for block in runs(0..table.len(), |row| (table.keys.experiments().code(row), table.keys.models().code(row))) {
            let key = table.keys.get(block.start);
            let rank = table.catalog.experiment_rank(key.experiment);
            rows.entry((rank, key.experiment)).or_default().push(block);
        }
        let mut experiments = Vec::with_capacity(rows.len());
        for ((_, name), blocks) in rows {
            let blocks = blocks.into_iter().map(|rows| Block::of(table, name, table.keys.get(rows.start).model, rows));
            experiments.push(Experiment { name, blocks: blocks.collect::<Result<_, _>>()? });
        }
        Ok(Self { table, experiments })
    }

    pub fn blocks(&self) -> impl Iterator<Item = &Block<'a>> {
        self.experiments.iter().flat_map(|experiment| &experiment.blocks)
    }

    pub fn column(&self, metric: &str) -> Option<&'a MetricColumn> {
        self.table.metrics.iter().find(|column| column.name == metric)
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
}

impl<'a> Block<'a> {
    fn of(
        table: &'a EpisodeTable,
        experiment: &'a str,
        model: &'a str,
        rows: Range<usize>,
    ) -> Result<Self, MomentOverflow> {
        let of_column = |column: &'a MetricColumn| {
            let moments = Moments::default().with_rows(column, rows.clone())?;
            Ok((column.name.as_str(), moments))
        };
        let moments = table.metrics.iter().map(of_column).collect::<Result<_, _>>()?;
        Ok(Self { experiment, model, rows, moments })
    }

    /// The exact moments of a metric of the table.
    pub fn moments(&self, column: &MetricColumn) -> Moments {
        self.moments[column.name.as_str()]
    }

    /// The rows of each seed.
    pub fn seeds(&self, table: &EpisodeTable) -> Vec<Range<usize>> {
        runs(self.rows.clone(), |row| table.keys.seed(row))
    }
}

impl Places {
    /// The places of an experiment's blocks.
    pub fn of(blocks: &[Block<'_>], table: &EpisodeTable) -> Self {
        let place = |row: usize| (table.keys.seed(row), table.keys.run(row));
        let of_block: Vec<_> = blocks.iter().map(|block| runs(block.rows.clone(), place)).collect();
        let mut all: Vec<Place> = of_block.iter().flatten().map(|rows| place(rows.start)).collect();
        all.sort_unstable();
        all.dedup();
        let rows = of_block.into_iter().map(|rows| {
            let mut rows = rows.into_iter().peekable();
            let at = |wanted: &Place| rows.next_if(|rows| place(rows.start) == *wanted).unwrap_or_default();
            all.iter().map(at).collect()
        });
        Self { rows: rows.collect(), all }
    }
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
