//! Experiments by the definitions that score them.

use std::collections::BTreeSet;

use metric::file;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ScoredAlike {
    /// The definitions, by name or by the original path of their file.
    pub definitions: String,
    /// SHA-256 of a definition file that is not built in.
    pub hash: Option<String>,
    /// The experiments by name, without those that no footer names.
    pub experiments: BTreeSet<String>,
    /// A condition that keeps only their episodes.
    pub condition: String,
}

impl ScoredAlike {
    pub(crate) fn is_built_in(&self) -> bool {
        self.hash.is_none() && file::built_in(&self.definitions).is_some()
    }
}
