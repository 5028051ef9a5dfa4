//! Replays traces and compares rows and frames with the recorded ones; writes new frames, logs and counts on the way.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Int32Array};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

use super::again::{Recipe, again};
use super::error::{Divergence, ReplayError};
use super::log::{Log, Seen};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::replace::TemporaryFolder;
use mirrorstats_sim::camera::Camera;
use mirrorstats_sim::config::WorldConfig;
use mirrorstats_sim::visibility::by_column;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::episodes::frame::{Frame, Likeness, TOLERANCE, likeness};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::log::assemble;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::renderer::{self, Renderer};
use mirrorstats_trace::write::merge::{self, EpisodeRows};

/// The limit of a replay's work: 11,000 steps with the usual grid, which take eight seconds; more for larger traces.
pub(super) fn check_rays(rays: u64, bytes: u64) -> Result<(), ReplayError> {
    let limit = Limit::new("rays in a replay (steps times the grid of visibility)", 3_500_000_000);
    limit.and_beyond(1 << 20, 12_288, bytes).check(rays).map_err(ReplayError::other)
}

/// The rays of a replay of this many steps.
pub(super) fn rays(steps: usize, eye: &WorldConfig) -> u64 {
    (u64::from(eye.eye.width) * u64::from(eye.eye.height_px)).saturating_mul(steps as u64)
}

pub struct RecordedTrace {
    pub path: PathBuf,
    pub rows: Vec<EpisodeRows>,
    recording: Value,
    recipe: Recipe,
}

#[derive(Clone, Debug, Default)]
pub struct Outputs {
    pub frames: Option<PathBuf>,
    pub log: Option<PathBuf>,
    /// The trace with recomputed visibility.
    pub recount: Option<Recount>,
}

#[derive(Clone, Debug)]
pub struct Recount {
    pub out: PathBuf,
    /// The threshold, pixels of the grid; by default the recorded one, scaled to the grid.
    pub threshold: Option<u32>,
    /// The grid of rays, width and height; by default the size of the view.
    pub grid: Option<(u32, u32)>,
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
    /// Steps whose `mirror_visible` is another than before, with `--recompute-visibility`.
    pub flipped: Option<usize>,
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
            let recipe = Recipe::of(&recording).map_err(named)?;
            let mut rows = merge::read(&input.path).map_err(ReplayError::other)?;
            rows.retain(|rows| episode.is_none_or(|id| rows.episode_id == id));
            traces.push(Self { path: input.path.clone(), rows, recording, recipe });
        }
        if traces.iter().all(|trace| trace.rows.is_empty()) {
            return Err(ReplayError::NoEpisode(episode.unwrap_or_default().to_owned()));
        }
        Ok(traces)
    }

    /// Rejects traces that would take too long to replay.
    pub fn check_work(traces: &[Self], outputs: &Outputs) -> Result<(), ReplayError> {
        let bytes =
            traces.iter().map(|trace| std::fs::metadata(&trace.path).map_or(0, |metadata| metadata.len())).sum();
        let steps = |trace: &Self| trace.rows.iter().map(EpisodeRows::len).sum();
        let all = traces.iter().map(|trace| rays(steps(trace), &trace.eye(outputs)));
        check_rays(all.fold(0, u64::saturating_add), bytes)
    }

    fn eye(&self, outputs: &Outputs) -> WorldConfig {
        outputs.recount.as_ref().map_or_else(|| self.recipe.eye.clone(), |recount| recount.eye(&self.recipe))
    }

    /// Replays the episodes and adds to `answer`; `save` writes a frame as PNG.
    pub fn replay<E: From<ReplayError>>(
        &self,
        outputs: &Outputs,
        answer: &mut ReplayAnswer,
        mut save: impl FnMut(&Path, &[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        let eye = self.eye(outputs);
        let camera = self.camera(outputs, answer)?;
        let parts = TemporaryFolder::private("replay").map_err(ReplayError::other)?;
        let mut player = TracePlayer { trace: self, outputs, eye: &eye, camera };
        let (mut logs, mut rewritten) = (Vec::new(), Vec::new());
        for rows in &self.rows {
            let episode = rows.episode().map_err(ReplayError::other)?;
            let part = parts.path().join(format!("{}.mcap", logs.len()));
            let (divergence, counts) = player.episode(&episode, &part, answer.frames.as_mut(), &mut save)?;
            answer.episodes += 1;
            answer.steps += episode.steps.len();
            answer.divergences.extend(divergence);
            logs.push((assemble::place(&episode), part));
            if outputs.recount.is_some() {
                *answer.flipped.get_or_insert(0) += counts.flipped(&episode);
                rewritten.push(rows.with_columns(&counts.columns()).map_err(ReplayError::other)?);
            }
        }
        if let Some(path) = &outputs.log {
            assemble::write(path, &logs, &self.recording).map_err(ReplayError::other)?;
        }
        if let Some(recount) = &outputs.recount {
            let recording = recounted(&self.recording, &eye);
            merge::write(&recount.out, Some(&recording), &rewritten).map_err(ReplayError::other)?;
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

impl Recount {
    fn eye(&self, recipe: &Recipe) -> WorldConfig {
        let mut config = recipe.eye.clone();
        if let Some((width, height)) = self.grid {
            let recorded = u64::from(config.eye.width) * u64::from(config.eye.height_px);
            let scaled = u64::from(config.evidence.mirror_self_px) * u64::from(width) * u64::from(height);
            config.evidence.mirror_self_px = u32::try_from(scaled.div_ceil(recorded.max(1))).unwrap_or(u32::MAX);
            (config.eye.width, config.eye.height_px) = (width, height);
        }
        config.evidence.mirror_self_px = self.threshold.unwrap_or(config.evidence.mirror_self_px);
        config
    }
}

struct TracePlayer<'a> {
    trace: &'a RecordedTrace,
    outputs: &'a Outputs,
    eye: &'a WorldConfig,
    camera: Option<Camera>,
}

impl TracePlayer<'_> {
    fn episode<E: From<ReplayError>>(
        &mut self,
        episode: &Episode,
        part: &Path,
        mut frames: Option<&mut FramesAnswer>,
        save: &mut impl FnMut(&Path, &[u8]) -> Result<(), E>,
    ) -> Result<(Option<Divergence>, RecordedCounts), E> {
        let unwritten = |fault: super::log::LogFault| ReplayError::other(fault.to_string());
        let log = self.outputs.log.as_ref().map(|_| Log::begin(part, episode).map(Log::in_large_chunks));
        let mut log = log.transpose().map_err(unwritten)?;
        let (mut counts, mut other_frame) = (RecordedCounts::default(), None);
        let divergence = again(&self.trace.recipe, self.eye, episode, |t, world, visibility, step| {
            counts.add(by_column(world, visibility), world.is_mirror_visible(visibility));
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
        let first = [divergence, other_frame].into_iter().flatten().min_by_key(|divergence| divergence.t);
        Ok((first, counts))
    }
}

#[derive(Default)]
struct RecordedCounts {
    px: Vec<(&'static str, Vec<i32>)>,
    visible: Vec<bool>,
}

impl RecordedCounts {
    fn add(&mut self, counts: Vec<(&'static str, i32)>, visible: bool) {
        // A scene has the same columns at every step.
        self.px.resize_with(counts.len(), Default::default);
        for (values, (column, count)) in self.px.iter_mut().zip(counts) {
            values.0 = column;
            values.1.push(count);
        }
        self.visible.push(visible);
    }

    fn flipped(&self, episode: &Episode) -> usize {
        episode.steps.iter().zip(&self.visible).filter(|(step, visible)| step.mirror_visible != **visible).count()
    }

    fn columns(self) -> Vec<(&'static str, ArrayRef)> {
        let px = self.px.into_iter().map(|(column, values)| (column, Arc::new(Int32Array::from(values)) as ArrayRef));
        let visible: ArrayRef = Arc::new(BooleanArray::from(self.visible));
        px.chain([("mirror_visible", visible)]).collect()
    }
}

fn recounted(recording: &Value, eye: &WorldConfig) -> Value {
    let mut recording = recording.clone();
    recording["visibility_threshold_px"] = json!(eye.evidence.mirror_self_px);
    recording["visibility_grid"] = json!({ "width": eye.eye.width, "height": eye.eye.height_px });
    recording
}

pub fn frame_path(folder: &Path, episode_id: &str, t: impl Display) -> PathBuf {
    folder.join(episode_id.replace('/', "-")).join(format!("t{t:0>3}.png"))
}
