//! Cells by seed, if the design declares that episodes of one seed depend on each other.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::study::{Block, RowKey, Study};
use exact::moments::Moments;
use metric::catalog::{Kind, StandardError};
use score::table::{EpisodeTable, MetricColumn};
use statistics::clustered::{Clustered, clustered, clustered_rate};
use statistics::coverage::{self, Withheld};
use statistics::design::Cluster;

/// The seeds of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClusterRow {
    #[serde(flatten)]
    pub key: RowKey,
    /// The metric.
    pub metric: String,
    /// The defined episodes.
    pub n: u64,
    /// The seeds with a defined episode.
    pub seeds: usize,
    /// The arithmetic mean.
    pub mean: Option<f64>,
    /// The sample standard error that takes episodes as independent.
    pub se: Option<f64>,
    /// The interval with seeds as independent units; `None` for fewer than two seeds.
    pub by_seed: Option<Clustered>,
    /// The reason why it has no interval.
    pub withheld: Option<Withheld>,
}

impl ClusterRow {
    pub(in crate::statistics) fn all(study: &Study, confidence: f64) -> Vec<Self> {
        if study.design.clusters() != Some(Cluster::Seed) {
            return Vec::new();
        }
        let of_block = |block| study.table.metrics.iter().map(move |column| Self::of(study, block, column, confidence));
        study.blocks().flat_map(of_block).collect()
    }

    fn of(study: &Study, block: &Block, column: &MetricColumn, confidence: f64) -> Self {
        let seeds = by_seed(study.table, block, column);
        let whole = block.moments(column);
        let found = match study.kind(&column.name) {
            Kind::Rate => clustered_rate(&seeds, confidence),
            Kind::Quantity => clustered(&seeds, confidence),
        };
        let range = study.range(&column.name);
        let interval = found.and_then(|found| found.interval).map(|interval| interval.within(range.low, range.high));
        let (interval, withheld) =
            coverage::given(interval, seeds.len() as u64, coverage::CLUSTERS, found.is_some_and(|it| it.se > 0.0));
        Self {
            key: block.key(),
            metric: column.name.clone(),
            n: whole.n,
            seeds: seeds.len(),
            mean: whole.mean(),
            se: whole.se(StandardError::Sample),
            by_seed: found.map(|found| Clustered { interval, ..found }),
            withheld,
        }
    }
}

fn by_seed(table: &EpisodeTable, block: &Block, column: &MetricColumn) -> Vec<Moments> {
    let add = |sum: Moments, value| sum.with(value).expect("a part of a block that was summed whole");
    let of_seed = |rows: Vec<usize>| rows.into_iter().filter_map(|row| column.get(row)).fold(Moments::default(), add);
    block.seeds(table).into_iter().map(of_seed).filter(|moments| moments.n > 0).collect()
}
