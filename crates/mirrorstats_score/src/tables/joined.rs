//! Tables made from others: two tables joined, and one with a label in its model names.

use std::collections::HashSet;

use crate::tables::builder::TableBuilder;
use crate::tables::order::order;
use crate::tables::table::{
    EpisodeKeys, EpisodeTable, Header, JoinError, LOST, TextColumn, UNUSABLE_REPLIES, default_text,
};
use mirrorstats_trace::schema;

impl EpisodeTable {
    /// The rows of two tables, in key order, with the experiments that the traces of either declare.
    pub fn joined(self, other: &Self) -> Result<Self, JoinError> {
        if self.catalog.hash != other.catalog.hash {
            return Err(JoinError::Definitions(self.catalog.name, other.catalog.name.clone()));
        }
        let columns = |table: &Self| {
            let Header { labels, metrics, .. } = table.header();
            let own = labels.into_iter().filter(|label| !may_be_absent(label));
            own.chain(metrics).collect::<Vec<_>>()
        };
        if columns(&self) != columns(other) {
            return Err(JoinError::Columns(columns(&self).join(", "), columns(other).join(", ")));
        }
        let Header { mut labels, .. } = self.header();
        let more: Vec<String> = other.header().labels.into_iter().filter(|label| !labels.contains(label)).collect();
        labels.extend(more);
        let ids: HashSet<&str> = self.keys.iter().map(|key| key.episode_id).collect();
        if let Some(twice) = other.keys.iter().find(|key| ids.contains(key.episode_id)) {
            return Err(JoinError::Episode(twice.episode_id.to_owned()));
        }
        let mut catalog = self.catalog.clone();
        catalog.declare(other.catalog.declared());
        let mut builder = TableBuilder::new(Header { catalog, labels: labels.clone(), ..self.header() });
        for table in [&self, other] {
            let columns: Vec<_> = labels.iter().map(|name| (table.label(name), default_text(name))).collect();
            for row in 0..table.len() {
                let label = |(column, default): &(Option<&TextColumn>, Option<&'static str>)| match column {
                    Some(column) => column.get(row).map(str::to_owned),
                    None => default.map(str::to_owned),
                };
                let labels: Vec<Option<String>> = columns.iter().map(label).collect();
                let metrics = table.metrics.iter().map(|metric| metric.get(row));
                builder.push(table.keys.get(row), labels.iter().map(Option::as_deref), metrics);
            }
        }
        let declared = self.declared.clone().joined(other.declared.clone());
        Ok(Self { declared, ..builder.finish() })
    }
}

impl EpisodeTable {
    /// The same episodes with a non-default label in the model's name: `model [label]`; and the previous position of
    /// each row.
    pub fn with_labelled_models(&self, label: &str) -> (Self, Vec<usize>) {
        let labels = self.label(label);
        let name = |row: usize| {
            let model = self.keys.get(row).model;
            let label = labels.and_then(|labels| labels.get(row)).filter(|text| Some(*text) != default_text(label));
            label.map_or_else(|| model.to_owned(), |label| format!("{model} [{label}]"))
        };
        let model: TextColumn = (0..self.len()).map(|row| Some(name(row))).collect();
        let keys = EpisodeKeys { model, ..self.keys.clone() };
        let rows: Vec<usize> = match order(&keys) {
            Some(order) => order.into_iter().map(|row| row as usize).collect(),
            None => (0..self.len()).collect(),
        };
        (Self { keys, ..self.clone() }.taken(&rows), rows)
    }
}

fn may_be_absent(label: &str) -> bool {
    [LOST, UNUSABLE_REPLIES].contains(&label) || schema::column(label).is_some()
}
