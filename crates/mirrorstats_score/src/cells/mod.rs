//! Cells: the episodes of one group under one metric.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::quality::CellKey;
use crate::tables::table::{CONDITION, EpisodeTable};
use mirrorstats_exact::moments::Moments;
use mirrorstats_metric::catalogs::catalog::{Catalog, Metric};
use mirrorstats_statistics::intervals::interval::Interval;

use group::{GroupError, membership};
use interval::{CONFIDENCE, cell_interval};

pub mod columns;
pub mod group;
pub mod interval;

/// All cells of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// The definitions that gave the values.
    pub catalog: Catalog,
    /// The key columns that were grouped by; `experiment, model` by default.
    pub by: Vec<String>,
    /// The metrics, in the order of the episode table.
    pub metrics: Vec<String>,
    /// The least and the largest possible mean of each metric; an empty vector means no bounds.
    pub ranges: Vec<Interval>,
    /// The groups, ascending by key; each has one cell per metric.
    pub groups: Vec<Group>,
}

#[derive(Clone, Copy, Debug)]
pub struct Cell<'c> {
    pub key: &'c [KeyValue],
    pub name: &'c str,
    pub metric: &'c Metric,
    pub moments: &'c Moments,
    /// The 95 % interval of the mean; `None` if withheld.
    pub interval: Option<Interval>,
}

impl Cells {
    /// Adds a group without episodes for each cell of which all episodes were lost, so that no model is left out. Only
    /// cells of experiments, models and conditions are known.
    pub fn add_lost<'k>(&mut self, lost: impl Iterator<Item = &'k CellKey>) {
        for cell in lost {
            let value = |name: &String| match name.as_str() {
                "experiment" => Some(KeyValue::Text(cell.experiment.clone())),
                "model" => Some(KeyValue::Text(cell.model.clone())),
                CONDITION => Some(KeyValue::Text(cell.condition.clone())),
                _ => None,
            };
            let Some(key) = self.by.iter().map(value).collect::<Option<Vec<_>>>() else { return };
            if let Err(at) = self.groups.binary_search_by(|group| group.key.cmp(&key)) {
                self.groups.insert(
                    at,
                    Group { key, episodes: 0, repeats: false, moments: vec![Moments::default(); self.metrics.len()] },
                );
            }
        }
    }

    /// For each episode of the table that was grouped, the index of its group.
    pub fn membership(&self, table: &EpisodeTable) -> Result<Vec<usize>, GroupError> {
        let occupied = self.groups.iter().enumerate().filter(|(_, group)| group.episodes > 0);
        let occupied: Vec<usize> = occupied.map(|(at, _)| at).collect();
        Ok(membership(table, &self.by)?.into_iter().map(|group| occupied[group]).collect())
    }

    /// Every cell, by group and metric.
    pub fn all(&self) -> impl Iterator<Item = Cell<'_>> {
        self.groups.iter().flat_map(|group| (0..self.metrics.len()).filter_map(|at| self.at(group, at)))
    }

    pub fn of_metric<'c>(&'c self, group: &'c Group, name: &str) -> Option<Cell<'c>> {
        self.at(group, self.metrics.iter().position(|metric| metric == name)?)
    }

    fn at<'c>(&'c self, group: &'c Group, at: usize) -> Option<Cell<'c>> {
        let (name, moments) = (self.metrics[at].as_str(), &group.moments[at]);
        let metric = self.catalog.metric.get(name)?;
        let range = self.ranges.get(at).copied().unwrap_or(Interval::UNBOUNDED);
        let (interval, _) = cell_interval(moments, metric, range, CONFIDENCE);
        // The intervals take episodes as independent.
        let interval = interval.filter(|_| !group.repeats);
        Some(Cell { key: &group.key, name, metric, moments, interval })
    }
}

/// The episodes with one key.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// A value for each column of `by`.
    pub key: Vec<KeyValue>,
    /// The number of episodes, defined or not.
    pub episodes: u64,
    /// The moments of each metric, in the order of [`Cells::metrics`].
    pub moments: Vec<Moments>,
    /// True if a scene, a declared cluster or a participant has several episodes: they are not independent.
    pub repeats: bool,
}

/// A value of a key column; integers order as integers, before text. In JSON: null, a number or a string.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum KeyValue {
    /// A null of an optional key column.
    Missing,
    /// `seed`, `run`.
    Int(i64),
    /// `experiment`, `model`, ...
    Text(String),
}

impl KeyValue {
    /// The value as text; `None` if it is missing.
    pub fn text(&self) -> Option<String> {
        (*self != Self::Missing).then(|| self.to_string())
    }
}

impl fmt::Display for KeyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => Ok(()),
            Self::Int(value) => value.fmt(f),
            Self::Text(value) => value.fmt(f),
        }
    }
}
