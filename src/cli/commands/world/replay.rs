//! `mirrorstats world replay`: repeats a trace's episodes and compares them with the recording.

use std::ffi::OsString;
use std::fmt::{self, Write as _};
use std::io;
use std::path::{Path, PathBuf};

use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::format::counted;
use mirrorstats_exact::replace;
use mirrorstats_record::replay::error::Divergence;
use mirrorstats_record::replay::verify::{FramesAnswer, Outputs, RecordedTrace, ReplayAnswer};
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
        let outputs = Outputs { frames: self.frames.clone(), log: self.mcap.clone() };
        outputs.check(&traces, self.episode.as_deref())?;
        let mut answer = ReplayAnswer::default();
        for trace in &traces {
            trace.replay(&outputs, &mut answer, save)?;
        }
        output::print_with(&answer, self.json, write_answer)?;
        Ok(if answer.divergences.is_empty() { Outcome::Done } else { Outcome::CheckFailed })
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
