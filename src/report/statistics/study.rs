//! The episode table seen by experiment and model: the blocks that every statistic compares.

use std::collections::BTreeMap;

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
    pub rows: Vec<usize>,
    moments: BTreeMap<&'a str, Moments>,
}

/// Where an episode stands in its block: what pairs it with another model's.
pub(super) type Place = (i32, i32);

impl<'a> Study<'a> {
    pub fn of(table: &'a EpisodeTable) -> Result<Self, MomentOverflow> {
        let mut rows: BTreeMap<(usize, &str), BTreeMap<&str, Vec<usize>>> = BTreeMap::new();
        for (row, key) in table.keys.iter().enumerate() {
            let rank = table.catalog.experiment_rank(key.experiment);
            rows.entry((rank, key.experiment)).or_default().entry(key.model).or_default().push(row);
        }
        let mut experiments = Vec::with_capacity(rows.len());
        for ((_, name), models) in rows {
            let blocks = models.into_iter().map(|(model, rows)| Block::of(table, name, model, rows));
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
        rows: Vec<usize>,
    ) -> Result<Self, MomentOverflow> {
        let of_column = |column: &'a MetricColumn| {
            let values = rows.iter().map(|&row| column.get(row));
            moments(values).map(|moments| (column.name.as_str(), moments))
        };
        let moments = table.metrics.iter().map(of_column).collect::<Result<_, _>>()?;
        Ok(Self { experiment, model, rows, moments })
    }

    /// The exact moments of a metric of the table.
    pub fn moments(&self, column: &MetricColumn) -> Moments {
        self.moments[column.name.as_str()]
    }

    /// The rows by seed and run; more than one where the same seed and run was recorded again.
    pub fn places(&self, table: &EpisodeTable) -> BTreeMap<Place, Vec<usize>> {
        let mut places: BTreeMap<Place, Vec<usize>> = BTreeMap::new();
        for &row in &self.rows {
            let key = table.keys.get(row);
            places.entry((key.seed, key.run)).or_default().push(row);
        }
        places
    }
}

/// The moments of the defined values.
pub(super) fn moments(values: impl IntoIterator<Item = Option<i64>>) -> Result<Moments, MomentOverflow> {
    values.into_iter().flatten().try_fold(Moments::default(), Moments::with)
}

/// The successes of a rate and its episodes, where every value is 0 or 1.
pub(super) fn counts(moments: &Moments) -> Option<(u64, u64)> {
    let successes = u64::try_from(moments.sum).ok()?;
    (successes <= moments.n && moments.sum == moments.sum_sq).then_some((successes, moments.n))
}
