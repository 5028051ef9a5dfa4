//! What an import leaves out: keys with lists or objects, and records that are not steps.

use std::collections::BTreeMap;

use mirrorstats_exact::escape::visible;

/// What was left out, and how often.
#[derive(Clone, Debug, Default)]
pub struct Notes {
    nested: BTreeMap<String, u64>,
    dropped: BTreeMap<String, u64>,
}

impl Notes {
    /// A note for each key with lists or objects that were left out, and for each kind of record that is not a step.
    pub fn texts(&self) -> Vec<String> {
        let nested = |(key, rows): (&String, &u64)| {
            format!(
                "left out: `{}`, a list or an object in {rows} lines; `--map COLUMN={0}.PATH` takes a value out of it",
                visible(key)
            )
        };
        let dropped = |(what, count): (&String, &u64)| format!("left out: {count} {}", visible(what));
        self.nested.iter().map(nested).chain(self.dropped.iter().map(dropped)).collect()
    }

    pub(super) fn leave_out(&mut self, key: &str, rows: u64) {
        *self.nested.entry(key.to_owned()).or_default() += rows;
    }

    pub(super) fn count(&mut self, what: String, count: u64) {
        if count > 0 {
            *self.dropped.entry(what).or_default() += count;
        }
    }
}
