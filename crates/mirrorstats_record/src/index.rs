//! Reads the content of a recording's folder, and never writes.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::continued;
use super::error::StoreError;
use super::lock::{entries_of, parts_of};
use super::metadata::{Recordings, difference};
use super::plan::Subject;
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::{self, EpisodeRows};
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::schema::RECORDING_KEY;

/// The recordings of one model and condition in a folder, which may be missing.
#[derive(Debug)]
pub struct RecordingIndex {
    folder: PathBuf,
    pub(crate) subject: Subject,
    pub(crate) recordings: Recordings,
}

/// The seed, run and repetition of an episode.
pub type Place = (i32, i32, i32);

impl RecordingIndex {
    pub fn new(folder: &Path, subject: Subject, recordings: Recordings) -> Self {
        Self { folder: folder.to_owned(), subject, recordings }
    }

    pub fn trace(&self, experiment: &Experiment) -> PathBuf {
        self.folder.join(format!("{}-{}.parquet", experiment.name(), self.subject.slug()))
    }

    pub fn log(&self, experiment: &Experiment) -> PathBuf {
        self.trace(experiment).with_extension("mcap")
    }

    pub fn recorded(&self, experiment: &Experiment) -> Result<BTreeSet<Place>, StoreError> {
        let episodes = self.episodes(experiment)?;
        self.check_log(experiment, &episodes)?;
        Ok(episodes.iter().map(place).collect())
    }

    pub(crate) fn episodes(&self, experiment: &Experiment) -> Result<Vec<EpisodeRows>, StoreError> {
        let trace = self.trace(experiment);
        let parts = self.parts_of(experiment)?;
        let mut episodes = Vec::new();
        for path in trace.exists().then_some(trace).iter().chain(&parts) {
            self.check(experiment, path)?;
            episodes.extend(episode_rows::read(path)?);
        }
        // An episode both in the trace and as a part is the same one: the process ended between assembling the trace
        // and removing the part.
        episodes.sort_by_key(|episode| (episode.seed, episode.run, episode.repetition));
        episodes.dedup_by(|later, earlier| later.episode_id == earlier.episode_id);
        Ok(episodes)
    }

    pub(crate) fn check_log(&self, experiment: &Experiment, episodes: &[EpisodeRows]) -> Result<(), StoreError> {
        continued::check(&self.log(experiment), &self.trace(experiment), self.recordings.get(experiment), episodes)
    }

    pub(crate) fn check(&self, experiment: &Experiment, path: &Path) -> Result<(), StoreError> {
        let difference = difference(self.recordings.get(experiment), &recording_of(path)?);
        difference.map_or(Ok(()), |difference| Err(StoreError::different(path, difference)))
    }

    pub(crate) fn parts_of(&self, experiment: &Experiment) -> Result<Vec<PathBuf>, StoreError> {
        let parts = parts_of(&self.folder);
        if !parts.exists() {
            return Ok(Vec::new());
        }
        let prefix = format!("{}-{}-s", experiment.name(), self.subject.slug());
        let is_own = |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let rest = name.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(".parquet"));
            rest.is_some_and(|rest| rest.bytes().all(|byte| byte.is_ascii_digit() || b"-rx".contains(&byte)))
        };
        let entries = entries_of(&parts)?;
        let mut found: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).filter(is_own).collect();
        found.sort();
        Ok(found)
    }
}

pub(crate) fn narrow(value: i64) -> i32 {
    i32::try_from(value).unwrap_or(i32::MAX)
}

pub(crate) fn recording_of(path: &Path) -> Result<Value, StoreError> {
    let input = Input { name: path.display().to_string(), path: path.to_owned() };
    let unopened = || StoreError::io("read", path)(io::Error::other("the file cannot be opened as a trace"));
    let file = TraceFile::open(&input)
        .map_err(|findings| TraceError::from_findings(findings).map_or_else(unopened, StoreError::Trace))?;
    let text = file.metadata_value(RECORDING_KEY).unwrap_or("{}");
    Ok(serde_json::from_str(text).unwrap_or(Value::Null))
}

pub(crate) fn place(episode: &EpisodeRows) -> Place {
    (narrow(episode.seed), narrow(episode.run), narrow(episode.repetition))
}
