//! Reply quality: counts of the column `reply_status`.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use arrow::array::ArrayRef;
use schemars::JsonSchema;
use serde::Serialize;

use crate::read::entry_use::EntryUse;
use crate::scan::EpisodeBatch;
use crate::schema;
use mirrorstats_exact::escape::visible;
use mirrorstats_parquet_pages::{Column, Keys};

pub const REPLY_STATUS: &str = "reply_status";
const READ: [&str; 2] = ["ok", "repaired"];

pub fn statuses() -> &'static [&'static str] {
    schema::column(REPLY_STATUS).map_or(&[], |column| column.values)
}

/// How many replies there are, and how many of them gave no decision.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ReplyCounts {
    /// Replies with a status.
    pub replies: u64,
    /// Those of another status than `ok` and `repaired`, by status.
    pub unreadable: BTreeMap<String, u64>,
}

impl ReplyCounts {
    pub fn add(&mut self, status: &str, replies: u64) {
        self.replies += replies;
        if replies > 0 && !Self::is_read(status) {
            *self.unreadable.entry(status.to_owned()).or_default() += replies;
        }
    }

    pub fn merge(&mut self, others: &Self) {
        self.replies += others.replies;
        for (status, replies) in &others.unreadable {
            *self.unreadable.entry(status.clone()).or_default() += replies;
        }
    }

    pub fn all_unreadable(&self) -> u64 {
        self.unreadable.values().sum()
    }

    pub fn is_read(status: &str) -> bool {
        READ.contains(&status)
    }

    pub(crate) fn of_batch(batch: &EpisodeBatch) -> Self {
        let texts = batch.texts.iter().find(|texts| texts.name == REPLY_STATUS);
        let keyed = texts.and_then(|texts| Keys::new(texts.keys.clone(), Arc::new(texts.texts.clone())));
        let flat = || Some(Column::Flat(ArrayRef::clone(batch.steps.column_by_name(REPLY_STATUS)?)));
        keyed.map(Column::Keys).or_else(flat).map_or_else(Self::default, |column| Self::of_column(&column))
    }

    pub(crate) fn of_column(column: &Column) -> Self {
        let mut counts = Self::default();
        if let Some(texts) = EntryUse::of_column(column) {
            texts.used().for_each(|(text, rows)| counts.add(text, rows));
        }
        counts
    }
}

/// The statuses without a decision and their numbers, as in `parse_failed 3, refusal 1`; a single status has no number.
impl fmt::Display for ReplyCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [status] = self.unreadable.keys().collect::<Vec<_>>()[..] {
            return f.write_str(&visible(status));
        }
        for (at, (status, replies)) in self.unreadable.iter().enumerate() {
            let comma = if at == 0 { "" } else { ", " };
            write!(f, "{comma}{} {replies}", visible(status))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::ReplyCounts;

    #[test]
    fn statuses_other_than_ok_and_repaired_are_counted_by_name() {
        let mut counts = ReplyCounts::default();
        assert_eq!((counts.all_unreadable(), counts.to_string()), (0, String::new()));
        for (status, replies) in [("ok", 5), ("repaired", 2), ("refusal", 1), ("empty", 0)] {
            counts.add(status, replies);
        }
        assert_eq!((counts.replies, counts.all_unreadable(), counts.to_string()), (8, 1, "refusal".to_owned()));
        let mut others = ReplyCounts::default();
        others.add("parse_failed", 3);
        others.add("refusal", 1);
        counts.merge(&others);
        assert_eq!((counts.replies, counts.to_string()), (12, "parse_failed 3, refusal 2".to_owned()));
    }
}
