//! Lost episodes by cell.

use std::collections::BTreeMap;

use crate::quality::CellKey;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LostCounts(BTreeMap<CellKey, u64>);

impl LostCounts {
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
