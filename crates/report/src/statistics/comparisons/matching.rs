//! Pairs of episodes of two blocks: those with the same scene.
//!
//! Rule: a pair is one episode of each side with one scene, if each side has exactly one with it. Only the scenes
//! decide whether two blocks are compared by pairs, before any outcome is read.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::study::{Block, Study};
use score::table::MetricColumn;
use statistics::paired::Pairs;

/// The matching of the episodes of two blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Matching {
    /// The pairs: scenes that each side has exactly once.
    pub pairs: u64,
    /// Episodes of either side whose scene the other side does not have.
    pub alone: u64,
    /// Episodes of either side whose scene both have, and one of them more than once.
    pub repeated: u64,
    /// Episodes of either side without a declared scene.
    pub undeclared: u64,
    /// True if the two are compared by their pairs: at least half of the episodes of each side are in one.
    pub paired: bool,
}

/// The episodes of one block by scene.
pub(in crate::statistics) struct Scenes {
    /// The rows of each scene, by its number in the table.
    pub rows: BTreeMap<usize, Vec<usize>>,
    undeclared: u64,
}

/// Two blocks' pairs, as rows of the table, in the order of the scenes.
pub(in crate::statistics) struct Matched {
    pub matching: Matching,
    /// The pairs if they are compared; otherwise `None`.
    pub pairs: Option<Vec<(usize, usize)>>,
}

/// The 2x2 table of a rate over pairs of rows; pairs with an undefined value do not count.
pub(in crate::statistics) fn outcomes(column: &MetricColumn, pairs: &[(usize, usize)]) -> Pairs {
    Pairs::of(pairs.iter().filter_map(|&(a, b)| Some((column.get(a)?, column.get(b)?))))
}

impl Scenes {
    pub fn of(study: &Study, block: &Block) -> Self {
        let mut found = Self { rows: BTreeMap::new(), undeclared: 0 };
        for row in block.rows() {
            match study.scenes().and_then(|scenes| scenes.code(row)) {
                Some(scene) => found.rows.entry(scene).or_default().push(row),
                None => found.undeclared += 1,
            }
        }
        found
    }

    fn episodes(&self) -> u64 {
        self.undeclared + self.rows.values().map(|rows| rows.len() as u64).sum::<u64>()
    }
}

impl Matched {
    pub fn of(first: &Scenes, second: &Scenes) -> Self {
        let mut matching = Matching { undeclared: first.undeclared + second.undeclared, ..Matching::default() };
        let mut pairs = Vec::new();
        for (scene, here) in &first.rows {
            match (here.as_slice(), second.rows.get(scene).map(Vec::as_slice)) {
                (here, None) => matching.alone += here.len() as u64,
                (&[a], Some(&[b])) => pairs.push((a, b)),
                (here, Some(there)) => matching.repeated += (here.len() + there.len()) as u64,
            }
        }
        let only_second = second.rows.iter().filter(|(scene, _)| !first.rows.contains_key(scene));
        matching.alone += only_second.map(|(_, rows)| rows.len() as u64).sum::<u64>();
        matching.pairs = pairs.len() as u64;
        let most = first.episodes().max(second.episodes());
        matching.paired = !pairs.is_empty() && 2 * matching.pairs >= most;
        Self { matching, pairs: matching.paired.then_some(pairs) }
    }
}
