//! `mirrorstats trace recover`: makes a trace from a log, even a truncated one.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::format::counted;
use mirrorstats_log::recover::{Losses, recover};
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceFile;
use mirrorstats_trace::validate::validate;
use mirrorstats_trace::write::OptionalColumns;
use mirrorstats_trace::write::merge::{self, EpisodeRows};

/// Make a trace from a log, even a truncated or damaged one
///
/// The trace gets every episode that ends in the log, and is checked against every rule. An existing trace is replaced
/// if it belongs to the same recording and the log has all its episodes with the same rows. Exits with 3 if any part of
/// the log is lost, even only the index at its end.
#[derive(Clone, Debug, clap::Args)]
pub struct RecoverArgs {
    /// The log
    #[arg(value_name = "LOG.mcap")]
    log: PathBuf,
    /// The trace to write
    #[arg(short, long, value_name = "TRACE.parquet")]
    out: PathBuf,
    /// Answer as JSON
    #[arg(long)]
    json: bool,
}

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

impl RecoverArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        output::check_target(&self.out, [&self.log])?;
        let recovered = recover(&self.log)?;
        let columns = recovered.recording.as_ref().map_or_else(OptionalColumns::all, OptionalColumns::recorded);
        let rows = recovered.episodes.iter().map(|episode| merge::rows(episode, &columns));
        let rows = rows.collect::<Result<Vec<_>, _>>()?;
        self.check_target(&rows, recovered.recording.as_ref())?;
        let answer = RecoverAnswer {
            episodes: rows.len(),
            steps: rows.iter().map(merge::EpisodeRows::len).sum(),
            written: !rows.is_empty(),
            losses: recovered.losses,
        };
        if answer.written {
            merge::write(&self.out, recovered.recording.as_ref(), &rows)?;
            self.check()?;
        }
        output::print(&answer, self.json)?;
        Ok(if answer.losses.is_any() { Outcome::Lossy } else { Outcome::Done })
    }

    /// Refuses to replace a trace of another recording, or one with episodes that the log lacks or has with other rows.
    fn check_target(&self, rows: &[EpisodeRows], recording: Option<&Value>) -> Result<(), Failure> {
        // A file that is not a readable trace may be replaced.
        let (Ok(file), Ok(there)) = (TraceFile::open(&self.target()), merge::read(&self.out)) else { return Ok(()) };
        let (out, log) = (self.out.display(), self.log.display());
        let refused =
            |why: String| Err(Failure::input(format!("{why}\n  help: name another file, or move that one away")));
        let ids: BTreeSet<&str> = rows.iter().map(|episode| episode.episode_id.as_str()).collect();
        if let Some(missing) = there.iter().find(|episode| !ids.contains(episode.episode_id.as_str())) {
            let id = &missing.episode_id;
            return refused(format!("`{out}` has the episode `{id}`, which cannot be recovered from the log"));
        }
        if without_seeds(Some(&file.recording())) != without_seeds(recording) {
            return refused(format!("`{out}` is a trace of another recording than the log"));
        }
        let hashes: BTreeMap<_, _> = rows.iter().map(|episode| (&episode.episode_id, episode.stated_hash())).collect();
        for episode in &there {
            let (id, logged) = (&episode.episode_id, hashes.get(&episode.episode_id).cloned().flatten());
            if let Some((traced, logged)) = episode.stated_hash().zip(logged).filter(|(a, b)| a != b) {
                return refused(format!(
                    "`{out}` and `{log}` do not belong together: expected rows of the episode `{id}` with the hash {traced}, \
                     as in the trace, found {logged}"
                ));
            }
        }
        Ok(())
    }

    fn target(&self) -> Input {
        Input { name: self.out.display().to_string(), path: self.out.clone() }
    }

    fn check(&self) -> Result<(), Failure> {
        let report = validate(&[self.target()], None, NonZeroUsize::MIN)?;
        match report.findings.iter().find(|finding| finding.severity == Severity::Error) {
            None => Ok(()),
            Some(finding) => Err(Failure::input(format!("the recovered trace breaks a rule: {finding}"))),
        }
    }
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
