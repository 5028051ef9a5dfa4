//! What is in the folder of a recording: read, and never written.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::claim;
use super::plan::slug;
use super::store::StoreError;
use crate::sim::Experiment;
use crate::trace::finding::TraceError;
use crate::trace::inputs::Input;
use crate::trace::merge;
use crate::trace::open::TraceFile;
use crate::trace::schema::RECORDING_KEY;

/// The key of the recording's metadata that grows with its episodes.
pub(super) const SEEDS: &str = "seeds";

/// The recordings of one model in a folder, which need not be there.
#[derive(Debug)]
pub struct Shelf {
    folder: PathBuf,
    model: String,
    recording: Value,
}

impl Shelf {
    /// The recordings of a model in a folder, with what a trace of it says of how it was recorded.
    pub fn new(folder: &Path, model: &str, recording: Value) -> Self {
        Self { folder: folder.to_owned(), model: model.to_owned(), recording }
    }

    pub(super) fn model(&self) -> &str {
        &self.model
    }

    pub(super) const fn recording(&self) -> &Value {
        &self.recording
    }

    /// The trace of an experiment.
    pub fn trace(&self, experiment: Experiment) -> PathBuf {
        self.folder.join(format!("{}-{}.parquet", experiment.name(), slug(&self.model)))
    }

    /// The log of an experiment.
    pub fn log(&self, experiment: Experiment) -> PathBuf {
        self.trace(experiment).with_extension("mcap")
    }

    /// The episodes of an experiment that are recorded, in the trace or as parts.
    ///
    /// # Errors
    /// When a trace or part cannot be read, or was recorded differently.
    pub fn recorded(&self, experiment: Experiment) -> Result<BTreeSet<(i32, i32)>, StoreError> {
        let mut found = BTreeSet::new();
        let trace = self.trace(experiment);
        let parts = self.parts_of(experiment)?;
        for path in trace.exists().then_some(trace).iter().chain(&parts) {
            self.check(path)?;
            for episode in merge::read(path)? {
                found.insert((narrow(episode.seed), narrow(episode.run)));
            }
        }
        Ok(found)
    }

    /// Refuses a file that was recorded with anything else than this recording.
    pub(super) fn check(&self, path: &Path) -> Result<(), StoreError> {
        let found = recording_of(path)?;
        let keys = |value: &Value| -> Vec<String> {
            value.as_object().map(|object| object.keys().cloned().collect()).unwrap_or_default()
        };
        let names = keys(&self.recording).into_iter().chain(keys(&found)).filter(|name| name != SEEDS);
        for name in names {
            let (ours, theirs) = (self.recording.get(&name), found.get(&name));
            if ours != theirs {
                let (expected, found) = first_difference(&name, ours, theirs);
                let path = path.to_owned();
                return Err(StoreError::Different { path, what: expected.0, expected: expected.1, found });
            }
        }
        Ok(())
    }

    /// The parts of an experiment, by name.
    pub(super) fn parts_of(&self, experiment: Experiment) -> Result<Vec<PathBuf>, StoreError> {
        let parts = claim::parts_of(&self.folder);
        if !parts.exists() {
            return Ok(Vec::new());
        }
        let prefix = format!("{}-{}-s", experiment.name(), slug(&self.model));
        let mut found = Vec::new();
        for entry in fs::read_dir(&parts).map_err(StoreError::io("read", &parts))? {
            let path = entry.map_err(StoreError::io("read", &parts))?.path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let rest = name.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(".parquet"));
            if rest.is_some_and(|rest| rest.bytes().all(|byte| byte.is_ascii_digit() || b"-r".contains(&byte))) {
                found.push(path);
            }
        }
        found.sort();
        Ok(found)
    }
}

pub(super) fn narrow(value: i64) -> i32 {
    i32::try_from(value).unwrap_or(i32::MAX)
}

fn recording_of(path: &Path) -> Result<Value, StoreError> {
    let input = Input { name: path.display().to_string(), path: path.to_owned() };
    let file = TraceFile::open(&input)
        .map_err(|findings| TraceError::of(findings).map_or_else(|| unreachable_fault(path), StoreError::Trace))?;
    let text = file.metadata_value(RECORDING_KEY).unwrap_or("{}");
    Ok(serde_json::from_str(text).unwrap_or(Value::Null))
}

fn unreachable_fault(path: &Path) -> StoreError {
    StoreError::io("read", path)(io::Error::other("the file cannot be opened as a trace"))
}

/// The innermost key in which two values differ, and both sides of it.
fn first_difference(name: &str, ours: Option<&Value>, theirs: Option<&Value>) -> ((String, String), String) {
    if let (Some(Value::Object(a)), Some(Value::Object(b))) = (ours, theirs) {
        let inner = a.keys().chain(b.keys()).find(|key| a.get(*key) != b.get(*key));
        if let Some(key) = inner {
            return first_difference(&format!("{name}.{key}"), a.get(key), b.get(key));
        }
    }
    let text = |value: Option<&Value>| value.map_or_else(|| "nothing".to_owned(), Value::to_string);
    ((name.to_owned(), text(ours)), text(theirs))
}
