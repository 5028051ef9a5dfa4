//! Replays traces and compares rows and frames with the recorded ones; writes new frames and logs on the way.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::again::{Recipe, again};
use super::error::{Divergence, ReplayError};
use super::log::{Log, Seen};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::replace::{TemporaryFolder, check_target, folder_of, is_same_file};
use mirrorstats_log::assemble;
use mirrorstats_log::read::{episode_hashes, other_episode};
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::footers::renderer::{self, Renderer};
use mirrorstats_trace::frame::{Frame, Likeness, TOLERANCE, likeness};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::{self, EpisodeRows};
use mirrorstats_trace::read::open::TraceSet;

/// The limit of a replay's work: 11,000 steps with the usual grid, which take eight seconds; more for larger traces.
pub(super) fn check_rays(rays: u64, bytes: u64) -> Result<(), ReplayError> {
    let limit = Limit::new("rays in a replay (steps times the grid of visibility)", 3_500_000_000);
    limit.and_beyond(1 << 20, 12_288, bytes).check(rays).map_err(ReplayError::other)
}

pub(super) fn rays(steps: usize, eye: &WorldConfig) -> u64 {
    (u64::from(eye.eye.width) * u64::from(eye.eye.height_px)).saturating_mul(steps as u64)
}

pub struct RecordedTrace {
    pub path: PathBuf,
    pub rows: Vec<EpisodeRows>,
    recording: Value,
    recipe: Recipe,
}

/// The result.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ReplayAnswer {
    /// Episodes that were replayed.
    pub episodes: usize,
    /// Their steps.
    pub steps: usize,
    /// The first divergence of each episode that has one.
    pub divergences: Vec<Divergence>,
    /// The frames, where traces say what their agents saw.
    pub frames: Option<FramesAnswer>,
}

/// How the frames of a replay compare with those that agents saw.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct FramesAnswer {
    /// Frames of the same bytes.
    pub equal: usize,
    /// Frames of other bytes whose digests have the same levels within `tolerance`.
    pub alike: usize,
    /// Other frames.
    pub different: usize,
    /// Levels of 255 by which the means of 8 x 6 blocks may differ in frames that are alike.
    pub tolerance: u8,
    /// What drew the recorded frames.
    pub recorded_with: Vec<Renderer>,
    /// What drew those of the replay; null where nothing could be drawn.
    pub drawn_with: Option<Renderer>,
    /// The reason why no frames were compared.
    pub not_compared: Option<String>,
}

impl RecordedTrace {
    pub fn open(files: &[Input], episode: Option<&str>) -> Result<Vec<Self>, ReplayError> {
        let set = TraceSet::open(files).map_err(ReplayError::other)?;
        let mut traces = Vec::new();
        for (input, file) in files.iter().zip(set.files()) {
            let recording = file.recording();
            let named = |fault| ReplayError::InTrace { trace: file.name().to_owned(), fault: Box::new(fault) };
            let recipe = Recipe::from_recording(&recording).map_err(named)?;
            let mut rows = episode_rows::read(&input.path).map_err(ReplayError::other)?;
            rows.retain(|rows| episode.is_none_or(|id| rows.episode_id == id));
            traces.push(Self { path: input.path.clone(), rows, recording, recipe });
        }
        if traces.iter().all(|trace| trace.rows.is_empty()) {
            return Err(ReplayError::NoEpisode(episode.unwrap_or_default().to_owned()));
        }
        Ok(traces)
    }

    fn check_work(traces: &[Self]) -> Result<(), ReplayError> {
        let bytes =
            traces.iter().map(|trace| std::fs::metadata(&trace.path).map_or(0, |metadata| metadata.len())).sum();
        let steps = |trace: &Self| trace.rows.iter().map(EpisodeRows::len).sum();
        let all = traces.iter().map(|trace| rays(steps(trace), &trace.recipe.config));
        check_rays(all.fold(0, u64::saturating_add), bytes)
    }

    /// Replays the episodes and adds to `answer`; `save` writes a frame as PNG.
    pub fn replay<E: From<ReplayError>>(
        &self,
        outputs: &Outputs,
        answer: &mut ReplayAnswer,
        mut save: impl FnMut(&Path, &[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut camera = self.camera(outputs, answer)?;
        let parts = TemporaryFolder::private("replay").map_err(ReplayError::other)?;
        let mut logs = Vec::new();
        for rows in &self.rows {
            let episode = rows.episode().map_err(ReplayError::other)?;
            let part = parts.path().join(format!("{}.mcap", logs.len()));
            let frames = answer.frames.as_mut();
            let divergence = self.episode(&episode, outputs, &part, (camera.as_mut(), frames), &mut save)?;
            answer.episodes += 1;
            answer.steps += episode.steps.len();
            answer.divergences.extend(divergence);
            logs.push((assemble::place(&episode), part));
        }
        if let Some(path) = &outputs.log {
            assemble::assemble(path, None, &logs, &self.recording, folder_of(path)).map_err(ReplayError::other)?;
        }
        Ok(())
    }

    fn camera(&self, outputs: &Outputs, answer: &mut ReplayAnswer) -> Result<Option<Camera>, ReplayError> {
        let is_written = outputs.frames.is_some() || outputs.log.is_some();
        let is_compared = self.recording["frame_digest"].is_string();
        if !is_written && !is_compared {
            return Ok(None);
        }
        let camera = match Camera::new(&self.recipe.config) {
            Err(error) if !is_written => Err(error),
            camera => Ok(camera.map_err(ReplayError::other)?),
        };
        if is_compared {
            let frames = answer.frames.get_or_insert_default();
            frames.add_trace(&self.recording, camera.as_ref().ok().map(Camera::drawn_by));
            frames.not_compared = camera.as_ref().err().map(ToString::to_string);
        }
        Ok(camera.ok())
    }

    fn episode<E: From<ReplayError>>(
        &self,
        episode: &Episode,
        outputs: &Outputs,
        part: &Path,
        (mut camera, mut frames): (Option<&mut Camera>, Option<&mut FramesAnswer>),
        save: &mut impl FnMut(&Path, &[u8]) -> Result<(), E>,
    ) -> Result<Option<Divergence>, E> {
        let unwritten = |fault: super::log::LogFault| ReplayError::other(fault.to_string());
        let log = outputs.log.as_ref().map(|_| Log::begin(part, episode).map(Log::in_large_chunks));
        let mut log = log.transpose().map_err(unwritten)?;
        let mut other_frame = None;
        let divergence = again(&self.recipe, &self.recipe.config, episode, i32::MAX, |t, world, visibility, step| {
            let frame = camera.as_mut().map(|camera| camera.frame(world)).transpose();
            let frame = frame.map_err(ReplayError::other)?.map(Arc::new);
            let recorded = step.extra.frame_digest.as_deref();
            if let (Some(frames), Some(recorded), Some(frame)) = (&mut frames, recorded, &frame) {
                let other = frames.add((&episode.episode_id, t), recorded, frame);
                other_frame = other_frame.take().or(other);
            }
            if let (Some(folder), Some(frame)) = (&outputs.frames, &frame) {
                let png = frame.to_png().map_err(ReplayError::other)?;
                save(&frame_path(folder, &episode.episode_id, t), png)?;
            }
            if let Some(log) = &mut log {
                let seen = Seen { t, world, frame: frame.as_ref(), visibility };
                log.seen(&seen).and_then(|()| log.done(t, step)).map_err(unwritten)?;
            }
            Ok::<(), E>(())
        })?;
        if let Some(log) = log {
            log.end(episode).map_err(unwritten)?;
        }
        Ok([divergence, other_frame].into_iter().flatten().min_by_key(|divergence| divergence.t))
    }
}

impl FramesAnswer {
    fn add_trace(&mut self, recording: &Value, drawn_with: Option<&Renderer>) {
        self.tolerance = TOLERANCE;
        self.drawn_with = drawn_with.cloned();
        for renderer in renderer::of_recording(recording) {
            if !self.recorded_with.contains(&renderer) {
                self.recorded_with.push(renderer);
            }
        }
    }

    fn add(&mut self, (episode_id, t): (&str, i32), recorded: &str, frame: &Frame) -> Option<Divergence> {
        let drawn = frame.digest();
        match likeness(recorded, &drawn) {
            Some(Likeness::Equal) => self.equal += 1,
            Some(Likeness::Alike) => self.alike += 1,
            Some(Likeness::Different) | None => {
                self.different += 1;
                return Some(Divergence {
                    episode_id: episode_id.to_owned(),
                    t,
                    column: "frame_digest".to_owned(),
                    expected: recorded.to_owned(),
                    found: drawn,
                });
            }
        }
        None
    }
}

fn frame_path(folder: &Path, episode_id: &str, t: impl Display) -> PathBuf {
    folder.join(episode_id.replace('/', "-")).join(format!("t{t:0>3}.png"))
}

/// The outputs of a replay.
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
