//! `mirrorstats world replay`: repeats a trace's episodes and compares them with the recording.

use std::ffi::OsString;
use std::fmt::{self, Write as _};
use std::io;
use std::path::{Path, PathBuf};

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::format::counted;
use mirrorstats_exact::replace::{self, is_same_file};
use mirrorstats_log::read::{episode_hashes, other_episode};
use mirrorstats_record::replay::error::{Divergence, ReplayError};
use mirrorstats_record::replay::verify::{FramesAnswer, Outputs, RecordedTrace, ReplayAnswer, frame_path};
use mirrorstats_trace::footers::renderer::Renderer;
use mirrorstats_trace::inputs;

/// Replay a trace's episodes in their recorded worlds, and compare every step with the recording
///
/// Poses, distances, pixel counts, `bumped` and `mirror_visible` must match, and frames that agents saw must look
/// alike: the same bytes, or mean levels within 2 of 255 in each of 8 x 6 blocks. Exits with 1 if they do not, and
/// prints the first divergence of each episode.
#[derive(Clone, Debug, clap::Args)]
pub struct ReplayArgs {
    /// Traces of `mirrorstats record`: files, folders or quoted globs
    #[arg(required = true, value_name = "TRACES")]
    traces: Vec<OsString>,
    /// Only this episode
    #[arg(long, value_name = "ID")]
    episode: Option<String>,
    /// Render every step into this folder, as EPISODE/t001.png
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Write a log of the replay, replacing an existing one; for a single trace. With --episode, a log with other
    /// episodes is refused
    #[arg(long, value_name = "LOG.mcap")]
    mcap: Option<PathBuf>,
    /// Answer as JSON
    #[arg(long)]
    json: bool,
}

impl ReplayArgs {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let files = inputs::resolve(&self.traces, io::stdin())?;
        output::note_stale_checksums(&files);
        let traces = RecordedTrace::open(&files, self.episode.as_deref())?;
        if traces.len() > 1 && self.mcap.is_some() {
            return Err(Failure::input("--mcap takes a single trace"));
        }
        RecordedTrace::check_work(&traces)?;
        self.check_targets(&traces)?;
        let mut answer = ReplayAnswer::default();
        for trace in &traces {
            trace.replay(&self.outputs(), &mut answer, save)?;
        }
        output::print_with(&answer, self.json, write_answer)?;
        Ok(if answer.divergences.is_empty() { Outcome::Done } else { Outcome::CheckFailed })
    }

    fn outputs(&self) -> Outputs {
        Outputs { frames: self.frames.clone(), log: self.mcap.clone() }
    }

    fn check_targets(&self, traces: &[RecordedTrace]) -> Result<(), Failure> {
        let is_trace = |target: &PathBuf| traces.iter().any(|trace| is_same_file(target, &trace.path));
        if self.mcap.as_ref().is_some_and(is_trace) {
            return Err(Failure::input("--mcap is the trace itself; name another file"));
        }
        for (folder, trace) in self.frames.iter().flat_map(|folder| traces.iter().map(move |trace| (folder, trace))) {
            for (rows, t) in trace.rows.iter().flat_map(|rows| (1..=rows.len()).map(move |t| (rows, t))) {
                output::check_target(&frame_path(folder, &rows.episode_id, t), traces.iter().map(|trace| &trace.path))?;
            }
        }
        self.check_log()?;
        self.check_hashes(traces)
    }

    fn check_hashes(&self, traces: &[RecordedTrace]) -> Result<(), Failure> {
        // A file that is not a readable log may be replaced.
        let Some((log, logged)) = self.mcap.as_ref().and_then(|log| Some((log, episode_hashes(log).ok()?))) else {
            return Ok(());
        };
        for (trace, rows) in traces.iter().flat_map(|trace| trace.rows.iter().map(move |rows| (trace, rows))) {
            let hashes = rows.stated_hash().zip(logged.get(&rows.episode_id));
            if let Some((traced, logged)) = hashes.filter(|(traced, logged)| traced != *logged) {
                let name = trace.path.display().to_string();
                return Err(ReplayError::apart(&rows.episode_id, (&name, &traced), (log, logged)).into());
            }
        }
        Ok(())
    }

    fn check_log(&self) -> Result<(), Failure> {
        let (Some(path), Some(id)) = (&self.mcap, &self.episode) else { return Ok(()) };
        if !path.is_file() {
            return Ok(());
        }
        let found = match other_episode(path, id) {
            Ok(None) => return Ok(()),
            Ok(Some(other)) => format!("one with the episode `{other}`"),
            Err(error) => {
                let error = error.to_string();
                format!("a file whose episodes cannot be read ({})", error.lines().next().unwrap_or_default())
            }
        };
        Err(Failure::Rendered(format!(
            "error: `{}`: expected no file, or a log of the episode `{id}` alone, found {found}\n  help: give --mcap another name, or leave out --episode to replace the whole log",
            path.display()
        )))
    }
}

fn save(path: &Path, png: &[u8]) -> Result<(), Failure> {
    output::make_folder(replace::folder_of(path))?;
    output::write_file(path, png)
}

fn write_frames(text: &mut String, frames: &FramesAnswer) -> fmt::Result {
    let FramesAnswer { equal, alike, different, tolerance, recorded_with, drawn_with, not_compared } = frames;
    if let Some(reason) = not_compared {
        return writeln!(text, "frames are not compared: {reason}");
    }
    writeln!(
        text,
        "frames: {equal} equal, {alike} alike (means of blocks within {tolerance} levels), {different} different"
    )?;
    let drawn_with = drawn_with.as_slice();
    if recorded_with != drawn_with {
        let names = |all: &[Renderer]| all.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
        writeln!(
            text,
            "different renderers: recorded with {}, replayed with {}",
            names(recorded_with),
            names(drawn_with)
        )?;
    }
    Ok(())
}

fn write_answer(text: &mut String, answer: &ReplayAnswer) -> fmt::Result {
    for Divergence { episode_id, t, column, expected, found } in &answer.divergences {
        // Hashes are enough for people.
        let [expected, found] = [expected, found].map(|text| match column.as_str() {
            "frame_digest" => text.split('-').next().unwrap_or_default(),
            _ => text,
        });
        writeln!(text, "{episode_id}, t = {t}: {column}: recorded {expected}, replayed {found}")?;
    }
    write!(text, "{}, {} replayed", counted(answer.episodes as u64, "episode"), counted(answer.steps as u64, "step"))?;
    match answer.divergences.len() {
        0 => writeln!(text, ": all match")?,
        1 => writeln!(text, ": 1 of the episodes parts from the trace")?,
        parted => writeln!(text, ": {parted} of the episodes part from the trace")?,
    }
    answer.frames.as_ref().map_or(Ok(()), |frames| write_frames(text, frames))
}
