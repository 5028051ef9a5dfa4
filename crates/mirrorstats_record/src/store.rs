//! The folder of a recording.
//!
//! ```text
//! OUT/E1-oracle.parquet            the trace of a model and an experiment, made of whole episodes
//! OUT/E1-oracle.mcap               its log
//! OUT/lost.jsonl                   episodes that failures kept from being recorded; no file if there are none
//! OUT/.parts/E1-oracle-s1-r3.*     episodes that are whole, and not in the trace yet
//! ```
//!
//! Rule: one process at a time records into a folder. It writes an episode under a temporary name, synchronises and
//! renames it, the trace last, so that it exists completely or not at all. The trace is assembled from the parts and its
//! previous content, by seed and run, and replaced in one step: when its experiment is complete, and at the end of the
//! recording.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value, json};

use super::error::StoreError;
use super::failures::{self, LostEpisode};
use super::fingerprint::Fingerprint;
use super::index::{RecordingIndex, place, recording_of};
use super::lock::{FolderLock, WRITING};
use super::metadata::{FINGERPRINTS, Recordings, SEEDS};
use super::plan::{Key, Subject};
use mirrorstats_agents::locked;
use mirrorstats_experiment::Experiment;
use mirrorstats_log::{LogError, assemble};
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::footers::renderer::{self, Renderer};
use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::write::merge;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

#[derive(Debug)]
pub struct Store {
    folder_lock: Arc<FolderLock>,
    /// The content of the folder.
    pub index: RecordingIndex,
}

impl Store {
    pub fn new(folder_lock: Arc<FolderLock>, subject: Subject, recordings: Recordings) -> Self {
        let index = RecordingIndex::new(folder_lock.folder(), subject, recordings);
        Self { folder_lock, index }
    }

    fn parts(&self) -> PathBuf {
        self.folder_lock.parts()
    }

    /// The file of an episode until the trace is assembled.
    pub fn part(&self, key: &Key) -> PathBuf {
        self.parts().join(format!("{}.parquet", key.file_stem(&self.index.subject)))
    }

    pub(crate) fn log_part(&self, key: &Key) -> PathBuf {
        self.part(key).with_extension("mcap")
    }

    pub fn note_lost(&self, recorded: &[Key], lost: &[LostEpisode]) -> Result<(), StoreError> {
        let _writing = locked(&WRITING);
        let recorded = recorded.iter().map(|key| key.episode_id(&self.index.subject)).collect();
        failures::update(&self.lost_list(), &recorded, lost)
    }

    pub fn lost_list(&self) -> PathBuf {
        failures::list_of(self.folder_lock.folder())
    }

    /// The fingerprint of an episode, given the model's id as the provider returned it and the renderer of the frames
    /// that the agent saw.
    pub fn fingerprint(&self, key: &Key, model: Option<&str>, renderer: Option<&Renderer>) -> Fingerprint {
        Fingerprint::new(self.index.recordings.get(&key.experiment), model, renderer)
    }

    /// Commits an episode whose log, if any, is already committed.
    pub fn commit(&self, key: &Key, episode: &Episode, fingerprint: &Fingerprint) -> Result<(), StoreError> {
        let path = self.part(key);
        let mut recording = self.index.recordings.get(&key.experiment).clone();
        let columns = OptionalColumns::recorded(&recording);
        recording[FINGERPRINTS] = json!({ fingerprint.id.as_str(): fingerprint.parts });
        let metadata = TraceMetadata { recording: Some(recording), columns };
        let mut writer = TraceWriter::create(&path, &metadata)?;
        writer.write(episode)?;
        Ok(writer.commit()?)
    }

    /// Assembles the trace and the log of an experiment from its parts; does nothing without parts.
    pub fn assemble(&self, experiment: &Experiment) -> Result<(), StoreError> {
        let _writing = locked(&WRITING);
        let parts = self.index.parts_of(experiment)?;
        if parts.is_empty() {
            return Ok(());
        }
        let trace = self.index.trace(experiment);
        let episodes = self.index.episodes(experiment)?;
        self.index.check_log(experiment, &episodes)?;
        let log_parts: Vec<PathBuf> = parts.iter().map(|part| part.with_extension("mcap")).collect();
        let mut recording = self.index.recordings.get(experiment).clone();
        let seeds: BTreeSet<i64> = episodes.iter().map(|episode| episode.seed).collect();
        recording[SEEDS] = json!(seeds);
        recording[FINGERPRINTS] = Self::fingerprints(&trace, &parts)?;
        self.assemble_log(experiment, &parts, &recording)?;
        merge::write_in(&self.parts(), &trace, Some(&recording), &episodes)?;
        for part in parts.iter().chain(log_parts.iter().filter(|part| part.exists())) {
            fs::remove_file(part).map_err(StoreError::io("remove", part))?;
        }
        Ok(())
    }

    fn fingerprints(trace: &Path, parts: &[PathBuf]) -> Result<Value, StoreError> {
        let mut all = BTreeMap::new();
        for path in trace.exists().then_some(trace).into_iter().chain(parts.iter().map(PathBuf::as_path)) {
            if let Some(Value::Object(some)) = recording_of(path)?.get_mut(FINGERPRINTS).map(Value::take) {
                all.extend(some);
            }
        }
        Ok(json!(all))
    }

    /// The renderers of the frames that agents saw in these experiments' traces, without duplicates.
    pub fn renderers(&self, experiments: &[Experiment]) -> Result<Vec<Renderer>, StoreError> {
        let mut found = Vec::new();
        for trace in experiments.iter().map(|experiment| self.index.trace(experiment)).filter(|trace| trace.exists()) {
            for renderer in renderer::of_recording(&recording_of(&trace)?) {
                if !found.contains(&renderer) {
                    found.push(renderer);
                }
            }
        }
        Ok(found)
    }

    fn assemble_log(&self, experiment: &Experiment, parts: &[PathBuf], recording: &Value) -> Result<(), StoreError> {
        let mut logs = Vec::new();
        for part in parts {
            let log = part.with_extension("mcap");
            if log.exists() {
                let episode = episode_rows::read(part)?;
                logs.extend(episode.first().map(|episode| (place(episode), log)));
            }
        }
        if logs.is_empty() {
            return Ok(());
        }
        let log = self.index.log(experiment);
        let before = log.exists().then_some(log.as_path());
        assemble::assemble(&log, before, &logs, recording, &self.parts()).map_err(|error| match error {
            LogError::Damaged { file, fault } if Path::new(&file) != log => {
                StoreError::DamagedPart { path: file.into(), fault }
            }
            error => error.into(),
        })
    }
}
