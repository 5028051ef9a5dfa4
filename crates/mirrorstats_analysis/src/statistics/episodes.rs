//! The episodes behind all numbers: the filter that chose them, and replies without a decision, whose steps still count.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Display;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::study::RowKey;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_score::tables::table::{CONDITION, EpisodeTable, UNUSABLE_REPLIES, UnusableCount};

/// The most cells that a sentence names; others are counted.
const NAMED_CELLS: usize = 3;

/// The replies of all episodes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Replies {
    /// The replies whose status is recorded.
    pub replies: u64,
    /// Those that gave no decision.
    pub unusable: u64,
    /// The cells that have such replies, by experiment, model and condition.
    pub cells: Vec<UnusableReplies>,
}

/// The replies of one cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct UnusableReplies {
    #[serde(flatten)]
    pub key: RowKey,
    /// The replies whose status is recorded.
    pub replies: u64,
    /// Those that gave no decision.
    pub unusable: u64,
}

impl Replies {
    /// `None` if no reply has a status.
    pub fn from_table(table: &EpisodeTable) -> Option<Self> {
        let label = table.label(UNUSABLE_REPLIES)?;
        let conditions = table.label(CONDITION).filter(|_| table.has_conditions());
        let mut cells: BTreeMap<(&str, &str, Option<&str>), UnusableCount> = BTreeMap::new();
        let mut all = UnusableCount::default();
        for (row, key) in table.keys.iter().enumerate() {
            let Some(found) = label.get(row).and_then(UnusableCount::of_label) else { continue };
            let condition = conditions.and_then(|conditions| conditions.get(row));
            cells.entry((key.experiment, key.model, condition)).or_default().add(found);
            all.add(found);
        }
        let cells =
            cells.into_iter().filter(|(_, count)| count.unusable > 0).map(|((experiment, model, condition), count)| {
                let (experiment, model, condition) =
                    (experiment.to_owned(), model.to_owned(), condition.map(str::to_owned));
                let UnusableCount { unusable, replies } = count;
                UnusableReplies { key: RowKey { experiment, model, condition }, replies, unusable }
            });
        (all.replies > 0).then_some(Self { replies: all.replies, unusable: all.unusable, cells: cells.collect() })
    }

    /// The number of replies without a decision, and the cells with the largest shares; `None` without any.
    pub fn sentence(&self) -> Option<String> {
        let mut cells: Vec<&UnusableReplies> = self.cells.iter().collect();
        // Compared as fractions, the largest first.
        cells.sort_by_key(|cell| Reverse(u128::from(cell.unusable) * 1_000_000 / u128::from(cell.replies.max(1))));
        let named = cells.iter().map(|cell| {
            let (experiment, model) = (visible(&cell.key.experiment), visible(&cell.key.name()));
            format!("{experiment} {model} {} of {}", cell.unusable, cell.replies)
        });
        let named = first_named(named, NAMED_CELLS);
        (self.unusable > 0).then(|| {
            let (unusable, replies) = (self.unusable, self.replies);
            format!(
                "{unusable} of {} gave no decision ({named}): a model that cannot be read is not told \
                 from one that fails.",
                counted(replies, "reply")
            )
        })
    }
}

pub(super) fn first_named(names: impl ExactSizeIterator<Item = String>, most: usize) -> String {
    let rest = names.len().saturating_sub(most);
    let first = names.take(most).collect::<Vec<_>>().join("; ");
    if rest > 0 { format!("{first}; and {rest} more") } else { first }
}

/// `3`, or `3 to 5`.
pub(crate) fn span<N: Copy + Display + PartialEq>(least: N, most: N) -> String {
    if least == most { least.to_string() } else { format!("{least} to {most}") }
}

/// A filter over episodes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Selection {
    /// The condition, as typed.
    pub condition: String,
    /// True if it depends on what the agents did, and not on what was recorded alone.
    pub by_results: bool,
}

impl Selection {
    pub(super) fn phrase(&self) -> String {
        let condition = visible(&self.condition);
        if self.by_results {
            format!("episodes chosen by their results: `{condition}`")
        } else {
            format!("only episodes where `{condition}`")
        }
    }

    /// The sentence beside tables and conclusions.
    pub fn sentence(&self) -> String {
        let chosen = if self.by_results {
            "; the filter chose them by their results, so no number here is about a model as such: a guesser's correct \
             episodes are all correct"
        } else {
            ""
        };
        format!("Only episodes where `{}`{chosen}.", visible(&self.condition))
    }
}
