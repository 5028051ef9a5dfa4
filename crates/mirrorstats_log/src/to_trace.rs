//! A trace from a log: every episode that the log has whole, checked against every rule.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::num::NonZeroUsize;
use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::error::LogError;
use super::recover::{Losses, recover};
use mirrorstats_exact::format::counted;
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::{self, EpisodeRows};
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::validate::validate;
use mirrorstats_trace::write::OptionalColumns;
use mirrorstats_trace::write::merge;

/// The result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RecoverAnswer {
    /// Episodes in the trace.
    pub episodes: usize,
    /// Their rows.
    pub steps: usize,
    /// True if a trace was written; not so without an episode.
    pub written: bool,
    /// The losses.
    pub losses: Losses,
}

#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("{0}\n  help: name another file, or move that one away")]
    Target(String),
    #[error("the recovered trace breaks a rule: {0}")]
    BrokenRule(String),
}

/// Writes the trace of a log; without a whole episode nothing is written.
pub fn recover_to_trace(log: &Path, out: &Path) -> Result<RecoverAnswer, RecoverError> {
    let recovered = recover(log)?;
    let recording = recovered.recording.as_ref();
    let columns = recording.map_or_else(OptionalColumns::all, OptionalColumns::recorded);
    let rows = recovered.episodes.iter().map(|episode| merge::rows(episode, &columns));
    let rows = rows.collect::<Result<Vec<_>, _>>()?;
    check_target(out, log, &rows, recording)?;
    let (episodes, steps) = (rows.len(), rows.iter().map(EpisodeRows::len).sum());
    let written = !rows.is_empty();
    if written {
        merge::write(out, recording, &rows)?;
        let report = validate(&[target(out)], None, NonZeroUsize::MIN)?;
        if let Some(broken) = report.findings.iter().find(|finding| finding.severity == Severity::Error) {
            return Err(RecoverError::BrokenRule(broken.to_string()));
        }
    }
    Ok(RecoverAnswer { episodes, steps, written, losses: recovered.losses })
}

/// Refuses to replace a trace of another recording, or one with episodes that the log lacks or has with other rows.
fn check_target(out: &Path, log: &Path, rows: &[EpisodeRows], recording: Option<&Value>) -> Result<(), RecoverError> {
    // A file that is not a readable trace may be replaced.
    let (Ok(file), Ok(there)) = (TraceFile::open(&target(out)), episode_rows::read(out)) else { return Ok(()) };
    let (out, log) = (out.display(), log.display());
    let ids: BTreeSet<&str> = rows.iter().map(|episode| episode.episode_id.as_str()).collect();
    if let Some(missing) = there.iter().find(|episode| !ids.contains(episode.episode_id.as_str())) {
        let id = &missing.episode_id;
        let words = format!("`{out}` has the episode `{id}`, which cannot be recovered from the log");
        return Err(RecoverError::Target(words));
    }
    if without_seeds(Some(&file.recording())) != without_seeds(recording) {
        return Err(RecoverError::Target(format!("`{out}` is a trace of another recording than the log")));
    }
    let hashes: BTreeMap<_, _> = rows.iter().map(|episode| (&episode.episode_id, episode.stated_hash())).collect();
    for episode in &there {
        let (id, logged) = (&episode.episode_id, hashes.get(&episode.episode_id).cloned().flatten());
        if let Some((traced, logged)) = episode.stated_hash().zip(logged).filter(|(a, b)| a != b) {
            return Err(RecoverError::Target(format!(
                "`{out}` and `{log}` do not belong together: expected rows of the episode `{id}` with the hash {traced}, \
                 as in the trace, found {logged}"
            )));
        }
    }
    Ok(())
}

fn target(out: &Path) -> Input {
    Input { name: out.display().to_string(), path: out.to_owned() }
}

fn without_seeds(recording: Option<&Value>) -> Value {
    let mut recording = recording.cloned().unwrap_or_default();
    if let Some(object) = recording.as_object_mut() {
        object.remove("seeds");
    }
    recording
}

impl fmt::Display for RecoverAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let episodes = counted(self.episodes as u64, "episode");
        let steps = counted(self.steps as u64, "step");
        if self.written {
            writeln!(f, "recovered {episodes}, {steps}")?;
        } else {
            writeln!(f, "recovered no episode; no trace was written")?;
        }
        for lost in &self.losses.episodes {
            let rows = counted(lost.rows as u64, "row");
            writeln!(f, "lost {}: {}; {rows} of it remain in the log", lost.episode_id, lost.reason)?;
        }
        if self.losses.stray_rows > 0 {
            writeln!(f, "lost {} of no known episode", counted(self.losses.stray_rows as u64, "row"))?;
        }
        if self.losses.damaged_chunks > 0 {
            writeln!(f, "{} damaged", counted(self.losses.damaged_chunks as u64, "chunk"))?;
        }
        for damage in &self.losses.damage {
            writeln!(f, "damaged: {damage}")?;
        }
        for reason in self.losses.recording.iter().chain(&self.losses.cut) {
            writeln!(f, "{reason}")?;
        }
        Ok(())
    }
}
