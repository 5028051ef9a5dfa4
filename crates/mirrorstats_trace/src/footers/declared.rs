//! The declarations of footers about the origin of the rows.
//!
//! Rule: missing declarations are not assumed. Files have a joint declaration if they all declare the same.
//! Declarations that rule out pairs or independence apply to all files.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::beside::lost::LostEpisode;
use crate::read::open::TraceSet;
use mirrorstats_exact::names;

names! {
    /// The origin of rows.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
    #[serde(rename_all = "lowercase")]
    pub enum Origin {
        /// This program recorded them.
        Recording = "recording",
        /// They were imported from another harness.
        Import = "import",
        /// They were rebuilt from published numbers: what those leave open is arbitrary.
        Reconstruction = "reconstruction",
    }
}

/// The unit that similar episodes share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cluster {
    /// The seed.
    Seed,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Registration {
    pub sha256: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub definitions: Option<String>,
}

/// What happened in an episode, without its names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepHashes {
    /// Equal for episodes with equal steps.
    pub print: (u64, u64),
    /// The first latencies in milliseconds; empty if they are not recorded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub latencies: Vec<i64>,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Declared {
    /// The origin of the rows, if all files declare the same; a reconstruction if any file is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    /// The declared cluster, if any file declares one: then no test treats episodes as independent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cluster: Option<Cluster>,
    /// The parts of each fingerprint, by its name in the column `fingerprint`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub fingerprints: BTreeMap<String, Value>,
    /// The fingerprints with different parts in different files.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub ambiguous: BTreeSet<String>,
    /// The footer's recording behind each fingerprint. Scores do not carry it.
    #[serde(skip)]
    pub recordings: BTreeMap<String, Arc<Value>>,
    /// The registration, if all files name the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub registration: Option<Registration>,
    /// Episodes that failures prevented, which are in no trace.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unrecorded: Vec<LostEpisode>,
    /// True if every file lists its lost episodes.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub losses_recorded: bool,
    /// The steps of each episode as hashes, by its id, so that copies are found among scores too. Traces have the steps.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub steps: BTreeMap<String, StepHashes>,
}

impl Declared {
    pub fn from_traces(traces: &TraceSet) -> Self {
        Self::of_files(traces).reduce(Self::joined).unwrap_or_default()
    }

    /// The declarations of each file.
    pub fn of_files(traces: &TraceSet) -> impl Iterator<Item = Self> {
        traces.files().iter().map(|file| Self::of_recording(&file.recording()))
    }

    fn of_recording(recording: &Value) -> Self {
        let fingerprints = recording["fingerprints"].as_object().cloned().unwrap_or_default();
        let shared = Arc::new(recording.clone());
        Self {
            recordings: fingerprints.keys().map(|name| (name.clone(), Arc::clone(&shared))).collect(),
            origin: recording["kind"].as_str().and_then(Origin::named),
            cluster: (recording["design"]["cluster"] == "seed").then_some(Cluster::Seed),
            fingerprints: fingerprints.into_iter().collect(),
            registration: serde_json::from_value(recording["registration"].clone()).unwrap_or_default(),
            ..Self::default()
        }
    }

    #[must_use]
    pub fn joined(mut self, other: Self) -> Self {
        let differs =
            |(name, parts): &(&String, &Value)| other.fingerprints.get(*name).is_some_and(|own| own != *parts);
        self.ambiguous.extend(self.fingerprints.iter().filter(differs).map(|(name, _)| name.clone()));
        self.ambiguous.extend(other.ambiguous);
        self.fingerprints.extend(other.fingerprints);
        self.recordings.extend(other.recordings);
        self.unrecorded.extend(other.unrecorded);
        self.unrecorded.sort();
        self.unrecorded.dedup();
        self.steps.extend(other.steps);
        let made_up = [self.origin, other.origin].into_iter().flatten().find(|it| *it == Origin::Reconstruction);
        Self {
            origin: self.origin.filter(|origin| other.origin == Some(*origin)).or(made_up),
            cluster: self.cluster.or(other.cluster),
            registration: self.registration.filter(|hash| other.registration.as_ref() == Some(hash)),
            losses_recorded: self.losses_recorded && other.losses_recorded,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{Cluster, Declared, Origin};
    use crate::footers::recording;

    #[test]
    fn files_declare_together_their_common_declarations() {
        let import = Declared::of_recording(&json!({ "kind": "import", "design": { "cluster": "seed" } }));
        assert_eq!((import.origin, import.cluster), (Some(Origin::Import), Some(Cluster::Seed)));
        let recording = Declared::of_recording(&json!({
            "kind": "recording", "fingerprints": { "a": { "model": "m" } }, "registration": { "sha256": "r" }
        }));
        assert_eq!(recording.registration.as_ref().map(|plan| plan.sha256.as_str()), Some("r"));
        let both = import.clone().joined(recording);
        assert_eq!((both.origin, both.cluster, both.registration), (None, Some(Cluster::Seed), None));
        assert_eq!(both.fingerprints["a"]["model"], "m");
        let made_up = Declared::of_recording(&json!({ "kind": "reconstruction" }));
        assert_eq!(import.clone().joined(made_up).origin, Some(Origin::Reconstruction));
        assert_eq!(import.clone().joined(import.clone()), import);
    }

    #[test]
    fn a_fingerprint_of_two_contents_is_ambiguous() {
        let of = |model: &str| {
            Declared::of_recording(&json!({ "kind": "recording", "fingerprints": { "a": { "model": model } } }))
        };
        assert!(of("m").joined(of("m")).ambiguous.is_empty());
        assert!(of("m").joined(of("n")).joined(of("n")).ambiguous.contains("a"));
    }

    #[test]
    fn an_absent_key_declares_nothing() {
        for text in [None, Some("no JSON"), Some("7"), Some(r#"{"kind":"other","design":7,"fingerprints":[]}"#)] {
            assert_eq!(Declared::of_recording(&recording(text)), Declared::default(), "{text:?}");
        }
    }
}
