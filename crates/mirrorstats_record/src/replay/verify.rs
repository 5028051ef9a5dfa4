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
use super::outputs::Outputs;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::replace::TemporaryFolder;
use mirrorstats_log::assemble;
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

    pub(super) fn check_work(traces: &[Self]) -> Result<(), ReplayError> {
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
        let camera = self.camera(outputs, answer)?;
        let parts = TemporaryFolder::private("replay").map_err(ReplayError::other)?;
        let mut player = TracePlayer { trace: self, outputs, camera };
        let mut logs = Vec::new();
        for rows in &self.rows {
            let episode = rows.episode().map_err(ReplayError::other)?;
            let part = parts.path().join(format!("{}.mcap", logs.len()));
            let divergence = player.episode(&episode, &part, answer.frames.as_mut(), &mut save)?;
            answer.episodes += 1;
            answer.steps += episode.steps.len();
            answer.divergences.extend(divergence);
            logs.push((assemble::place(&episode), part));
        }
        if let Some(path) = &outputs.log {
            assemble::write(path, &logs, &self.recording).map_err(ReplayError::other)?;
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

struct TracePlayer<'a> {
    trace: &'a RecordedTrace,
    outputs: &'a Outputs,
    camera: Option<Camera>,
}

impl TracePlayer<'_> {
    fn episode<E: From<ReplayError>>(
        &mut self,
        episode: &Episode,
        part: &Path,
        mut frames: Option<&mut FramesAnswer>,
        save: &mut impl FnMut(&Path, &[u8]) -> Result<(), E>,
    ) -> Result<Option<Divergence>, E> {
        let unwritten = |fault: super::log::LogFault| ReplayError::other(fault.to_string());
        let log = self.outputs.log.as_ref().map(|_| Log::begin(part, episode));
        let mut log = log.transpose().map_err(unwritten)?;
        let mut other_frame = None;
        let divergence =
            again(&self.trace.recipe, &self.trace.recipe.config, episode, i32::MAX, |t, world, visibility, step| {
                let frame = self.camera.as_mut().map(|camera| camera.frame(world)).transpose();
                let frame = frame.map_err(ReplayError::other)?.map(Arc::new);
                let recorded = step.extra.frame_digest.as_deref();
                if let (Some(frames), Some(recorded), Some(frame)) = (&mut frames, recorded, &frame) {
                    let other = frames.add((&episode.episode_id, t), recorded, frame);
                    other_frame = other_frame.take().or(other);
                }
                if let (Some(folder), Some(frame)) = (&self.outputs.frames, &frame) {
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

pub(super) fn frame_path(folder: &Path, episode_id: &str, t: impl Display) -> PathBuf {
    folder.join(episode_id.replace('/', "-")).join(format!("t{t:0>3}.png"))
}
