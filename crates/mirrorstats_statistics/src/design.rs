//! The design of a study, as declared by its recorder: what pairs episodes, what groups them.
//!
//! Rule: only declared structure is assumed. Equal seeds and runs alone make neither pairs nor clusters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The design that the traces declare; empty by default.
///
/// Pairs are episodes with the same scene, which is a column of the traces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Design {
    /// The origin of the episodes; null if the traces do not say it or differ.
    pub kind: Option<DesignKind>,
    /// The unit within which episodes depend on each other; null if none is declared.
    pub cluster: Option<Cluster>,
}

/// The origin of episodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DesignKind {
    /// An agent took these steps in a world, and this program wrote them down.
    Recording,
    /// Another harness wrote them down.
    Import,
    /// Steps made up so that aggregates come out as published: seeds, runs and scenes mean nothing.
    Reconstruction,
}

/// The unit that dependent episodes share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cluster {
    /// The seed: episodes of one seed share something that those of another do not, such as a room.
    Seed,
}

impl Design {
    /// Returns true if equal scenes make pairs; those of a reconstruction are made up, like its outcomes.
    pub fn has_pairs(self) -> bool {
        self.kind != Some(DesignKind::Reconstruction)
    }

    /// The unit of dependent episodes; always `None` in a reconstruction.
    pub fn clusters(self) -> Option<Cluster> {
        self.cluster.filter(|_| self.kind != Some(DesignKind::Reconstruction))
    }
}

#[cfg(test)]
mod tests {
    use super::{Cluster, Design, DesignKind};

    #[test]
    fn a_reconstruction_never_has_pairs_or_clusters() {
        let made_up = Design { kind: Some(DesignKind::Reconstruction), cluster: Some(Cluster::Seed) };
        assert_eq!((made_up.has_pairs(), made_up.clusters()), (false, None));
        let recorded = Design { kind: Some(DesignKind::Recording), cluster: Some(Cluster::Seed) };
        assert_eq!((recorded.has_pairs(), recorded.clusters()), (true, Some(Cluster::Seed)));
        assert_eq!(Design::default().clusters(), None);
    }

    #[test]
    fn names_are_lower_case() {
        let declared = Design { kind: Some(DesignKind::Import), cluster: Some(Cluster::Seed) };
        assert_eq!(serde_json::to_string(&declared).unwrap(), r#"{"kind":"import","cluster":"seed"}"#);
    }
}
