//! The values of key columns that a reader can select.

use std::collections::BTreeMap;

use serde_json::{Value as Json, json};

use crate::cells::{Cells, KeyValue};
use crate::layout::{MetricTable, heading};
use exact::escape::visible;

/// The filters of a page, and the index of each value in its filter.
#[derive(Debug)]
pub(super) struct Filters {
    pub(super) filters: Vec<Json>,
    places: Vec<BTreeMap<KeyValue, usize>>,
}

impl Filters {
    /// The values in the rows of `tables`, in order of first appearance.
    pub(super) fn of(tables: &[MetricTable], cells: &Cells, undefined: &str) -> Self {
        let mut values: Vec<Vec<KeyValue>> = vec![Vec::new(); cells.by.len()];
        let mut places: Vec<BTreeMap<KeyValue, usize>> = vec![BTreeMap::new(); cells.by.len()];
        for row in tables.iter().flat_map(|table| &table.groups).flat_map(|group| &group.rows) {
            for ((value, values), places) in row.key.iter().zip(&mut values).zip(&mut places) {
                places.entry(value.clone()).or_insert_with(|| {
                    values.push(value.clone());
                    values.len() - 1
                });
            }
        }
        let filter = |(key, values): (usize, Vec<KeyValue>)| {
            let values: Vec<String> = values.iter().map(|value| shown(value, undefined)).collect();
            json!({ "key": key, "column": visible(&cells.by[key]), "heading": visible(&heading(&cells.by[key])), "values": values })
        };
        let several = values.into_iter().enumerate().filter(|(_, values)| values.len() > 1);
        Self { filters: several.map(filter).collect(), places }
    }

    /// The index of a row's value for each key column: `0,3`.
    pub(super) fn places(&self, key: &[KeyValue]) -> String {
        let place = |(value, places): (&KeyValue, &BTreeMap<KeyValue, usize>)| places.get(value).copied();
        let places = key.iter().zip(&self.places).filter_map(place);
        places.map(|place| place.to_string()).collect::<Vec<_>>().join(",")
    }
}

pub(super) fn shown(value: &KeyValue, undefined: &str) -> String {
    match value {
        KeyValue::Missing => visible(undefined),
        value => visible(&value.to_string()),
    }
}
