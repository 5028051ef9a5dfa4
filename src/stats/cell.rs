//! Cells: the episodes of one group under one metric.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::moments::Moments;
use crate::metric::catalog::Catalog;

/// All cells of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Cells {
    /// The definitions that gave the values.
    pub catalog: Catalog,
    /// The key columns that were grouped by, `experiment, model` unless asked otherwise.
    pub by: Vec<String>,
    /// The metrics, in the order of the episode table.
    pub metrics: Vec<String>,
    /// The groups, ascending by key; each has one cell per metric.
    pub groups: Vec<Group>,
}

/// The episodes that share a key.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// A value for each column of `by`.
    pub key: Vec<KeyValue>,
    /// How many episodes there are, defined or not.
    pub episodes: u64,
    /// The moments of each metric, in the order of [`Cells::metrics`].
    pub moments: Vec<Moments>,
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

impl fmt::Display for KeyValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => Ok(()),
            Self::Int(value) => value.fmt(f),
            Self::Text(value) => value.fmt(f),
        }
    }
}
