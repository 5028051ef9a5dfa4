//! The episode table: one row an episode, its keys and one integer a metric.

use std::collections::HashSet;

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
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
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

/// One row of the table, on its way into it or out of it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EpisodeRow {
    /// What names the episode.
    pub key: EpisodeKey,
    /// A value for each of [`Header::labels`].
    pub labels: Vec<Option<String>>,
    /// A value for each of [`Header::metrics`]; `None` where the metric is undefined.
    pub metrics: Vec<Option<i64>>,
}

/// What stands above the rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The definitions that gave the values.
    pub catalog: Catalog,
    /// The names of the further key columns.
    pub labels: Vec<String>,
    /// The names of the metrics, in their order.
    pub metrics: Vec<String>,
}

/// Why two tables are not one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JoinError {
    /// They were computed under different definitions.
    #[error("expected scores under one set of definitions, found `{0}` and another `{1}`; score the traces again")]
    Definitions(String, String),
    /// They have different columns.
    #[error("expected the columns {0}, found {1}")]
    Columns(String, String),
    /// They share an episode.
    #[error("the episode `{0}` is in two files of scores; leave one out")]
    Episode(String),
}

impl EpisodeTable {
    /// A table without a row.
    pub fn empty(header: Header) -> Self {
        let Header { catalog, labels, metrics } = header;
        Self {
            catalog,
            keys: Vec::new(),
            labels: labels.into_iter().map(|name| LabelColumn { name, values: Vec::new() }).collect(),
            metrics: metrics.into_iter().map(|name| MetricColumn { name, values: Vec::new() }).collect(),
        }
    }

    /// Adds a row, which must not come before the last one.
    pub fn push(&mut self, row: EpisodeRow) {
        self.keys.push(row.key);
        for (column, value) in self.labels.iter_mut().zip(row.labels) {
            column.values.push(value);
        }
        for (column, value) in self.metrics.iter_mut().zip(row.metrics) {
            column.values.push(value);
        }
    }

    /// What stands above the rows.
    pub fn header(&self) -> Header {
        Header {
            catalog: self.catalog.clone(),
            labels: self.labels.iter().map(|label| label.name.clone()).collect(),
            metrics: self.metrics.iter().map(|metric| metric.name.clone()).collect(),
        }
    }

    /// The rows, in order.
    pub fn rows(&self) -> impl Iterator<Item = EpisodeRow> {
        self.keys.iter().enumerate().map(|(row, key)| EpisodeRow {
            key: key.clone(),
            labels: self.labels.iter().map(|label| label.values[row].clone()).collect(),
            metrics: self.metrics.iter().map(|metric| metric.values[row]).collect(),
        })
    }

    /// The number of episodes.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// The rows of two tables.
    ///
    /// # Errors
    /// When they differ in their definitions or columns, or have an episode in common.
    pub fn joined(mut self, other: Self) -> Result<Self, JoinError> {
        if self.catalog.hash != other.catalog.hash {
            return Err(JoinError::Definitions(self.catalog.name, other.catalog.name));
        }
        let columns = |table: &Self| {
            let labels = table.labels.iter().map(|label| label.name.clone());
            labels.chain(table.metrics.iter().map(|metric| metric.name.clone())).collect::<Vec<_>>()
        };
        if columns(&self) != columns(&other) {
            return Err(JoinError::Columns(columns(&self).join(", "), columns(&other).join(", ")));
        }
        let ids: HashSet<&str> = self.keys.iter().map(|key| key.episode_id.as_str()).collect();
        if let Some(twice) = other.keys.iter().find(|key| ids.contains(key.episode_id.as_str())) {
            return Err(JoinError::Episode(twice.episode_id.clone()));
        }
        self.keys.extend(other.keys);
        for (column, more) in self.labels.iter_mut().zip(other.labels) {
            column.values.extend(more.values);
        }
        for (column, more) in self.metrics.iter_mut().zip(other.metrics) {
            column.values.extend(more.values);
        }
        Ok(self.sorted())
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
