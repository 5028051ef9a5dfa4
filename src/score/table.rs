//! The episode table: one row an episode, its keys and one integer a metric.

use crate::metric::catalog::Catalog;

/// Scores of some episodes, ordered by experiment, model, seed, run, `episode_id` (bytes and integers, ascending).
#[derive(Clone, Debug, PartialEq)]
pub struct EpisodeTable {
    /// The definitions that gave the values.
    pub catalog: Catalog,
    /// The keys, a row an episode.
    pub keys: Vec<EpisodeKey>,
    /// Further columns that are constant in an episode (`body_color`, ...), where they were asked for.
    pub labels: Vec<LabelColumn>,
    /// The metrics in the order of the catalog, or of the selection made.
    pub metrics: Vec<MetricColumn>,
}

/// What names an episode. The derived order is the order of the table.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EpisodeKey {
    /// `E1`..`E5` in the paper.
    pub experiment: String,
    /// The model's name in tables.
    pub model: String,
    /// The seed of the block of runs.
    pub seed: i32,
    /// The run within the seed.
    pub run: i32,
    /// Unique in a report.
    pub episode_id: String,
}

/// A further key column: text, `None` where the trace has null.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelColumn {
    /// The column's name in the trace.
    pub name: String,
    /// A value an episode.
    pub values: Vec<Option<String>>,
}

/// The values of one metric.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MetricColumn {
    /// The metric's name in the catalog.
    pub name: String,
    /// A value an episode; `None` where the metric is undefined.
    pub values: Vec<Option<i64>>,
}

impl EpisodeTable {
    /// The number of episodes.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// The same rows in the order of their keys.
    #[must_use]
    pub fn sorted(self) -> Self {
        if self.keys.is_sorted() {
            return self;
        }
        let mut order: Vec<usize> = (0..self.keys.len()).collect();
        order.sort_unstable_by(|&a, &b| self.keys[a].cmp(&self.keys[b]));
        let mut keys: Vec<Option<EpisodeKey>> = self.keys.into_iter().map(Some).collect();
        let moved = |mut column: LabelColumn| {
            column.values = order.iter().map(|&row| column.values[row].take()).collect();
            column
        };
        let copied = |mut column: MetricColumn| {
            column.values = order.iter().map(|&row| column.values[row]).collect();
            column
        };
        Self {
            catalog: self.catalog,
            labels: self.labels.into_iter().map(moved).collect(),
            metrics: self.metrics.into_iter().map(copied).collect(),
            keys: order.iter().filter_map(|&row| keys[row].take()).collect(),
        }
    }

    /// Whether there is no episode.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }
}
