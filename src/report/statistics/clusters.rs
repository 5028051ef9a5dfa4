//! Cells by seed: what a claim about new seeds could rest on.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Block, Study};
use crate::metric::catalog::{Kind, StandardError};
use crate::score::table::{EpisodeTable, MetricColumn};
use crate::stats::clustered::{Clustered, clustered};
use crate::stats::moments::Moments;

/// The seeds of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ClusterRow {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
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
    /// What takes seeds as independent instead; none for fewer than two seeds. Of a rate, the interval is cut
    /// to [0, 1].
    pub by_seed: Option<Clustered>,
}

impl ClusterRow {
    /// Every metric of every experiment and model.
    pub(super) fn all(study: &Study, confidence: f64) -> Vec<Self> {
        let of_block = |block| study.table.metrics.iter().map(move |column| Self::of(study, block, column, confidence));
        study.blocks().flat_map(of_block).collect()
    }

    fn of(study: &Study, block: &Block, column: &MetricColumn, confidence: f64) -> Self {
        let seeds = by_seed(study.table, block, column);
        let whole = block.moments(column);
        Self {
            experiment: block.experiment.to_owned(),
            model: block.model.to_owned(),
            metric: column.name.clone(),
            n: whole.n,
            seeds: seeds.len(),
            mean: whole.mean(),
            se: whole.se(StandardError::Sample),
            by_seed: clustered(&seeds, confidence).map(|found| match study.kind(&column.name) {
                Kind::Rate => Clustered { interval: found.interval.within(0.0, 1.0), ..found },
                Kind::Quantity => found,
            }),
        }
    }
}

/// The moments of each seed that has a defined value, by seed.
fn by_seed(table: &EpisodeTable, block: &Block, column: &MetricColumn) -> Vec<Moments> {
    let of_seed = |rows| Moments::default().with_rows(column, rows).expect("a part of a block that was summed whole");
    block.seeds(table).into_iter().map(of_seed).filter(|moments| moments.n > 0).collect()
}
