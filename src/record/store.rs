//! The folder of a recording.
//!
//! ```text
//! OUT/E1-oracle.parquet            the trace of a model and an experiment, made of whole episodes
//! OUT/E1-oracle.mcap               its log
//! OUT/lost.jsonl                   episodes that failures kept from being recorded; no file if there are none
//! OUT/.parts/E1-oracle-s1-r3.*     episodes that are whole, and not in the trace yet
//! ```
//!
//! Rule: an episode is written under a temporary name, synchronised, and renamed, its trace last: it is there whole or
//! not at all. The trace is put together from the parts and from what was there, by seed and run, and replaced in one
//! step; so any number of processes may record into one folder, and each leaves the same trace.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::claim::Claim;
use super::lost::{self, LostEpisode};
use super::plan::Key;
use super::shelf::{SEEDS, Shelf, narrow};
use crate::log::{LogError, assemble};
use crate::sim::Experiment;
use crate::trace::episode::Episode;
use crate::trace::finding::TraceError;
use crate::trace::merge;
use crate::trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

/// A trace that is being put together; by its name it is cleared away if that is not brought to an end.
const UNFINISHED_TRACE: &str = ".mirrorstats-assembled";

/// The folder of a recording, for one model.
#[derive(Debug)]
pub struct Store {
    claim: Claim,
    shelf: Shelf,
    columns: OptionalColumns,
}

/// Why the folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The operating system refuses.
    #[error("cannot {doing} `{}`: {source}\n  help: is the folder writable, and the disk not full?", path.display())]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// What is there was recorded differently.
    #[error(
        "`{}` was recorded with another {what}: expected {expected}, found {found}\n  \
         help: record into another folder, or remove the file to record it anew",
        path.display()
    )]
    Different {
        /// The file.
        path: PathBuf,
        /// What differs: a key of the recording's metadata.
        what: String,
        /// What this recording has.
        expected: String,
        /// What the file has.
        found: String,
    },
    /// A trace cannot be read or written.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// A log cannot be read or written.
    #[error(transparent)]
    Log(#[from] LogError),
}

impl StoreError {
    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { doing, path: path.to_owned(), source: crate::base::temporary::without_name(source) }
    }
}

impl Store {
    /// Opens the folder, which is made if need be.
    ///
    /// # Errors
    /// When it cannot be made or written to.
    pub fn open(folder: &Path, model: &str, recording: Value) -> Result<Self, StoreError> {
        let columns = OptionalColumns::recorded(&recording);
        Ok(Self { claim: Claim::stake(folder)?, shelf: Shelf::new(folder, model, recording), columns })
    }

    fn parts(&self) -> PathBuf {
        self.claim.parts()
    }

    /// The trace of an experiment.
    pub fn trace(&self, experiment: Experiment) -> PathBuf {
        self.shelf.trace(experiment)
    }

    /// The log of an experiment.
    pub fn log(&self, experiment: Experiment) -> PathBuf {
        self.shelf.log(experiment)
    }

    fn part(&self, key: Key) -> PathBuf {
        self.parts().join(format!("{}.parquet", key.file_stem(self.shelf.model())))
    }

    /// Where the log of an episode is committed.
    pub fn log_part(&self, key: Key) -> PathBuf {
        self.part(key).with_extension("mcap")
    }

    /// The episodes of an experiment that are recorded, in the trace or as parts.
    ///
    /// # Errors
    /// When a trace or part cannot be read, or was recorded differently.
    pub fn recorded(&self, experiment: Experiment) -> Result<BTreeSet<(i32, i32)>, StoreError> {
        // A part that another process is taking over into the trace is in neither for a moment.
        let _lock = self.claim.lock()?;
        self.shelf.recorded(experiment)
    }

    /// Brings the list of lost episodes up to date: these are recorded, those were lost now.
    ///
    /// # Errors
    /// When the list cannot be read or written.
    pub fn note_lost(&self, recorded: impl Iterator<Item = Key>, lost: &[LostEpisode]) -> Result<(), StoreError> {
        let _lock = self.claim.lock()?;
        let recorded = recorded.map(|key| key.episode_id(self.shelf.model())).collect();
        lost::update(&self.lost_list(), &recorded, lost)
    }

    /// Where lost episodes are listed.
    pub fn lost_list(&self) -> PathBuf {
        lost::list_of(self.claim.folder())
    }

    /// Commits an episode whose log, if there is one, is committed already.
    ///
    /// # Errors
    /// Whatever writing gives; the episode is not there then.
    pub fn commit(&self, key: Key, episode: &Episode) -> Result<(), StoreError> {
        let path = self.part(key);
        let metadata = TraceMetadata { recording: Some(self.shelf.recording().clone()), columns: self.columns.clone() };
        let mut writer = TraceWriter::create(&path, &metadata)?;
        writer.write(episode)?;
        writer.finish_durably()?;
        synchronise(&self.parts())
    }

    /// Puts the trace and the log of an experiment together from what is there; nothing if there are no parts.
    ///
    /// # Errors
    /// Whatever reading and writing give; the parts stay then.
    pub fn assemble(&self, experiment: Experiment) -> Result<(), StoreError> {
        let _lock = self.claim.lock()?;
        let parts = self.shelf.parts_of(experiment)?;
        if parts.is_empty() {
            return Ok(());
        }
        let trace = self.trace(experiment);
        let mut episodes = if trace.exists() { merge::read(&trace)? } else { Vec::new() };
        for part in &parts {
            self.shelf.check(part)?;
            episodes.extend(merge::read(part)?);
        }
        // An episode that was committed and is in the trace already is the same one: the trace was put together, and the
        // process ended before the part was removed.
        episodes.sort_by_key(|episode| (episode.seed, episode.run));
        episodes.dedup_by(|later, earlier| later.episode_id == earlier.episode_id);
        let log_parts: Vec<PathBuf> = parts.iter().map(|part| part.with_extension("mcap")).collect();
        let mut recording = self.shelf.recording().clone();
        let seeds: BTreeSet<i64> = episodes.iter().map(|episode| episode.seed).collect();
        recording[SEEDS] = json!(seeds);
        self.assemble_log(experiment, &parts, &recording)?;
        let whole = self.parts().join(UNFINISHED_TRACE);
        merge::write(&whole, Some(&recording), &episodes)?;
        fs::rename(&whole, &trace).map_err(StoreError::io("write", &trace))?;
        synchronise(self.claim.folder())?;
        for part in parts.iter().chain(log_parts.iter().filter(|part| part.exists())) {
            fs::remove_file(part).map_err(StoreError::io("remove", part))?;
        }
        Ok(())
    }

    /// Puts the log together from the parts that have one.
    fn assemble_log(&self, experiment: Experiment, parts: &[PathBuf], recording: &Value) -> Result<(), StoreError> {
        let mut logs = Vec::new();
        for part in parts {
            let log = part.with_extension("mcap");
            if log.exists() {
                let episode = merge::read(part)?;
                logs.extend(episode.first().map(|episode| ((narrow(episode.seed), narrow(episode.run)), log)));
            }
        }
        if logs.is_empty() {
            return Ok(());
        }
        let log = self.log(experiment);
        let before = log.exists().then_some(log.as_path());
        Ok(assemble::assemble(&log, before, &logs, recording, &self.parts())?)
    }
}

fn synchronise(path: &Path) -> Result<(), StoreError> {
    File::open(path).and_then(|file| file.sync_all()).map_err(StoreError::io("write", path))
}
