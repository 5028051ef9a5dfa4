//! Rows of two tables for the same episode.

use std::cmp::Ordering;

use super::{EpisodeName, Overlap, Pair};
use score::table::{EpisodeKeys, EpisodeTable};

/// The rows of two tables by their keys; both are in key order.
#[derive(Default)]
pub(super) struct Aligned {
    pub(super) both: Vec<Pair<usize>>,
    only_before: Vec<usize>,
    only_after: Vec<usize>,
}

impl Aligned {
    pub(super) fn of(before: &EpisodeKeys, after: &EpisodeKeys) -> Self {
        let mut aligned = Self::default();
        if before.has_keys_of(after) {
            // One scan scored both, so keys need not be read. Comparing them takes a third of a diff.
            aligned.both.extend((0..before.len()).map(|row| Pair { before: row, after: row }));
            return aligned;
        }
        let (mut old, mut new) = (0, 0);
        while old < before.len() && new < after.len() {
            let order = before.get(old).cmp(&after.get(new));
            match order {
                Ordering::Less => aligned.only_before.push(old),
                Ordering::Greater => aligned.only_after.push(new),
                Ordering::Equal => aligned.both.push(Pair { before: old, after: new }),
            }
            old += usize::from(order.is_le());
            new += usize::from(order.is_ge());
        }
        aligned.only_before.extend(old..before.len());
        aligned.only_after.extend(new..after.len());
        aligned
    }

    pub(super) fn overlap(&self, before: &EpisodeTable, after: &EpisodeTable) -> Overlap<EpisodeName> {
        let names = |rows: &[usize], table: &EpisodeTable| -> Vec<EpisodeName> {
            rows.iter().map(|row| EpisodeName::from(table.keys.get(*row))).collect()
        };
        Overlap {
            both: self.both.len() as u64,
            only_before: names(&self.only_before, before),
            only_after: names(&self.only_after, after),
        }
    }
}
