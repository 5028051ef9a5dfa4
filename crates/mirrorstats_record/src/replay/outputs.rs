//! The outputs of a replay, and their checks before it starts.

use std::path::{Path, PathBuf};

use super::error::ReplayError;
use super::verify::{RecordedTrace, frame_path};
use mirrorstats_exact::replace::{check_target, is_same_file};
use mirrorstats_log::read::{episode_hashes, other_episode};

#[derive(Clone, Debug, Default)]
pub struct Outputs {
    pub frames: Option<PathBuf>,
    pub log: Option<PathBuf>,
}

impl Outputs {
    /// Refuses traces that would take too long, and outputs that would replace a trace, or a log of other rows or, for a
    /// replay of one episode, of other episodes.
    pub fn check(&self, traces: &[RecordedTrace], episode: Option<&str>) -> Result<(), ReplayError> {
        if traces.len() > 1 && self.log.is_some() {
            return Err(ReplayError::other("--mcap takes a single trace"));
        }
        RecordedTrace::check_work(traces)?;
        let is_trace = |target: &PathBuf| traces.iter().any(|trace| is_same_file(target, &trace.path));
        if self.log.as_ref().is_some_and(is_trace) {
            return Err(ReplayError::other("--mcap is the trace itself; name another file"));
        }
        for (folder, trace) in self.frames.iter().flat_map(|folder| traces.iter().map(move |trace| (folder, trace))) {
            for (rows, t) in trace.rows.iter().flat_map(|rows| (1..=rows.len()).map(move |t| (rows, t))) {
                let frame = frame_path(folder, &rows.episode_id, t);
                let read = traces.iter().map(|trace| &trace.path);
                check_target(&frame, read, "one that is read").map_err(ReplayError::other)?;
            }
        }
        let Some(log) = self.log.as_deref().filter(|log| log.is_file()) else { return Ok(()) };
        if let Some(id) = episode {
            check_episodes(log, id)?;
        }
        check_hashes(log, traces)
    }
}

fn check_hashes(log: &Path, traces: &[RecordedTrace]) -> Result<(), ReplayError> {
    // A file that is not a readable log may be replaced.
    let Ok(logged) = episode_hashes(log) else { return Ok(()) };
    for (trace, rows) in traces.iter().flat_map(|trace| trace.rows.iter().map(move |rows| (trace, rows))) {
        let hashes = rows.stated_hash().zip(logged.get(&rows.episode_id));
        if let Some((traced, logged)) = hashes.filter(|(traced, logged)| traced != *logged) {
            let name = trace.path.display().to_string();
            return Err(ReplayError::apart(&rows.episode_id, (&name, &traced), (log, logged)));
        }
    }
    Ok(())
}

fn check_episodes(log: &Path, id: &str) -> Result<(), ReplayError> {
    let found = match other_episode(log, id) {
        Ok(None) => return Ok(()),
        Ok(Some(other)) => format!("one with the episode `{other}`"),
        Err(error) => {
            let error = error.to_string();
            format!("a file whose episodes cannot be read ({})", error.lines().next().unwrap_or_default())
        }
    };
    Err(ReplayError::other(format!(
        "`{}`: expected no file, or a log of the episode `{id}` alone, found {found}\n  help: give --mcap another name, or leave out --episode to replace the whole log",
        log.display()
    )))
}
