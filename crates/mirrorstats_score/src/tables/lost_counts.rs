//! Lost episodes by cell.

use std::collections::BTreeMap;

use crate::quality::CellKey;
use crate::tables::table::{CONDITION, EpisodeTable, default_text};

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LostCounts(BTreeMap<CellKey, u64>);

impl LostCounts {
    /// The lost episodes of a table: rows that are marked, and episodes that were never recorded.
    pub fn of_table(table: &EpisodeTable) -> Self {
        let default = default_text(CONDITION).unwrap_or_default();
        let cell = |experiment: &str, model: &str, condition: Option<&str>| CellKey {
            experiment: experiment.to_owned(),
            model: model.to_owned(),
            condition: condition.unwrap_or(default).to_owned(),
        };
        let mut counts = Self::default();
        for row in (0..table.len()).filter(|row| table.is_lost(*row)) {
            let key = table.keys.get(row);
            counts.add(cell(key.experiment, key.model, table.label(CONDITION).and_then(|label| label.get(row))));
        }
        for episode in &table.declared.unrecorded {
            counts.add(cell(&episode.experiment, &episode.model, episode.condition.as_deref()));
        }
        counts
    }

    pub fn add(&mut self, key: CellKey) {
        *self.0.entry(key).or_default() += 1;
    }

    pub fn iter(&self) -> impl Iterator<Item = (&CellKey, &u64)> {
        self.0.iter()
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn total(&self) -> u64 {
        self.0.values().sum()
    }

    /// The lost episodes of an experiment and model, under one condition or under any.
    pub fn of(&self, experiment: &str, model: &str, condition: Option<&str>) -> u64 {
        let is_wanted = |key: &CellKey| {
            key.experiment == experiment
                && key.model == model
                && condition.is_none_or(|condition| key.condition == condition)
        };
        self.0.iter().filter(|(key, _)| is_wanted(key)).map(|(_, lost)| lost).sum()
    }
}
