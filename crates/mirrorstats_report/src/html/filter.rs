//! The values of key columns that a reader can select.

use indexmap::IndexSet;
use serde_json::{Value as Json, json};

use crate::layout::{MetricTable, heading};
use mirrorstats_exact::escape::visible;
use mirrorstats_score::cells::{Cells, KeyValue};

#[derive(Debug)]
pub(super) struct Filters {
    pub(super) filters: Vec<Json>,
    values: Vec<IndexSet<KeyValue>>,
}

impl Filters {
    /// The values in the rows of `tables`, in order of first appearance.
    pub(super) fn of(tables: &[MetricTable], cells: &Cells, undefined: &str) -> Self {
        let mut values: Vec<IndexSet<KeyValue>> = vec![IndexSet::new(); cells.by.len()];
        for row in tables.iter().flat_map(MetricTable::rows) {
            for (value, values) in row.key.iter().zip(&mut values) {
                values.insert(value.clone());
            }
        }
        let filter = |(key, values): (usize, &IndexSet<KeyValue>)| {
            let values: Vec<String> = values.iter().map(|value| shown(value, undefined)).collect();
            json!({ "key": key, "column": visible(&cells.by[key]), "heading": visible(&heading(&cells.by[key])), "values": values })
        };
        let several = values.iter().enumerate().filter(|(_, values)| values.len() > 1);
        Self { filters: several.map(filter).collect(), values }
    }

    /// The index of a row's value for each key column: `0,3`.
    pub(super) fn places(&self, key: &[KeyValue]) -> String {
        let places = key.iter().zip(&self.values).filter_map(|(value, values)| values.get_index_of(value));
        places.map(|place| place.to_string()).collect::<Vec<_>>().join(",")
    }
}

pub(super) fn shown(value: &KeyValue, undefined: &str) -> String {
    match value {
        KeyValue::Missing => visible(undefined),
        value => visible(&value.to_string()),
    }
}
