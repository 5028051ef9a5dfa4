//! Removes a person from a recording's folder: from traces, logs, labels and journals.

use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use super::index::recording_of;
use super::lock::{FolderLock, WRITING, parts_of};
use mirrorstats_agents::human::journal;
use mirrorstats_agents::locked;
use mirrorstats_log::assemble;
use mirrorstats_trace::beside::labels;
use mirrorstats_trace::read::episode_rows::{self, EpisodeRows};
use mirrorstats_trace::write::merge;

/// The removed episodes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Removed {
    /// The episodes, by id.
    pub episodes: BTreeSet<String>,
    /// The traces and logs that were written anew, or removed as nothing was left.
    pub files: Vec<String>,
    /// The lines of the journal.
    pub journal_lines: usize,
    /// The lines of labels and notes of these episodes, whoever put them.
    pub label_lines: usize,
}

pub(crate) type RemovalError = Box<dyn Error + Send + Sync>;

/// Removes all data of the person with this code from a folder, into which nobody may record meanwhile.
pub fn remove(folder: &Path, code: &str) -> Result<Removed, RemovalError> {
    if !folder.is_dir() {
        return Err(format!("{}: expected the folder of a recording, found none", folder.display()).into());
    }
    let _lock = FolderLock::take(folder)?;
    let mut removed = remove_episodes(folder, code)?;
    removed.journal_lines = journal::remove(folder, code)?;
    Ok(removed)
}

/// Removes the episodes of a person from the traces, logs and labels of a folder, for the process that has its lock.
pub fn remove_episodes(folder: &Path, code: &str) -> Result<Removed, RemovalError> {
    let _writing = locked(&WRITING);
    let mut removed = Removed::default();
    for trace in traces(folder).into_iter().chain(traces(&parts_of(folder))) {
        remove_from(&trace, code, &mut removed)?;
    }
    Ok(removed)
}

/// The trace is last: until then, the same command finds the rest again.
fn remove_from(trace: &Path, code: &str, removed: &mut Removed) -> Result<(), RemovalError> {
    let (own, others) = parted(trace, code)?;
    if own.is_empty() {
        return Ok(());
    }
    removed.label_lines += labels::remove(&labels::list_beside(trace), &own)?;
    let recording = recording_of(trace)?;
    let log = trace.with_extension("mcap");
    if log.is_file() {
        if others.is_empty() {
            fs::remove_file(&log)?;
        } else {
            assemble::without(&log, &own, &recording)?;
        }
        removed.files.push(name(&log));
    }
    if others.is_empty() {
        fs::remove_file(trace)?;
    } else {
        merge::write(trace, Some(&recording), &others)?;
    }
    removed.files.push(name(trace));
    removed.episodes.extend(own);
    Ok(())
}

/// The ids of a person's episodes, and the episodes of the others.
fn parted(trace: &Path, code: &str) -> Result<(BTreeSet<String>, Vec<EpisodeRows>), RemovalError> {
    let (mut own, mut others) = (BTreeSet::new(), Vec::new());
    for rows in episode_rows::read(trace)? {
        if rows.episode()?.participant.as_deref() == Some(code) {
            own.insert(rows.episode_id);
        } else {
            others.push(rows);
        }
    }
    Ok((own, others))
}

fn traces(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_trace = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "parquet") && path.is_file();
    let mut traces: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_trace).collect();
    traces.sort();
    traces
}

fn name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}
