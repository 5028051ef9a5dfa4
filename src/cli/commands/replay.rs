//! `mirrorstats replay`: a trace's episodes again, held against what was recorded.

use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Int32Array};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

use crate::base::frame::Frame;
use crate::base::replace::{self, is_same_file};
use crate::cli::listing::counted;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::log::assemble::{self, Place};
use crate::log::read::other_episode;
use crate::record::log::Log;
use crate::record::plan::Key;
use crate::record::play::Seen;
use crate::replay::again::{Divergence, MOST_RAYS, Recipe, ReplayError, again};
use crate::sim::Experiment;
use crate::sim::config::WorldConfig;
use crate::sim::eye::Eye;
use crate::trace::episode::Episode;
use crate::trace::inputs;
use crate::trace::merge::{self, EpisodeRows};
use crate::trace::open::TraceSet;
use crate::trace::schema::RECORDING_KEY;

/// Repeat a trace's episodes in the worlds that it describes, and hold every step against what was recorded
///
/// Poses, distances, pixel counts, `bumped` and `mirror_visible` must match. Exits with 1 where they do not; the first divergence of
/// each episode is printed.
#[derive(Clone, Debug, clap::Args)]
pub struct ReplayArgs {
    /// Traces of `mirrorstats record`: files, folders or quoted globs
    #[arg(required = true, value_name = "TRACES")]
    traces: Vec<String>,
    /// Only this episode
    #[arg(long, value_name = "ID")]
    episode: Option<String>,
    /// Render every step into this folder, as EPISODE/t001.png
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Write a log of the replay in place of the log that is there; for a single trace. With --episode, a log that has
    /// other episodes is refused
    #[arg(long, value_name = "LOG.mcap")]
    mcap: Option<PathBuf>,
    /// Count pixels and decide visibility anew, into the trace of --out; for a single trace
    #[arg(long, requires = "out")]
    recompute_visibility: bool,
    /// The threshold for visibility, pixels of the grid [default: the recorded one, scaled to the grid]
    #[arg(long, value_name = "PX", requires = "recompute_visibility")]
    threshold: Option<u32>,
    /// The grid of rays, such as 320x240 [default: the size of the view]
    #[arg(long, value_name = "WxH", requires = "recompute_visibility", value_parser = grid)]
    grid: Option<(u32, u32)>,
    /// The trace to write with --recompute-visibility
    #[arg(short, long, value_name = "TRACE.parquet", requires = "recompute_visibility")]
    out: Option<PathBuf>,
    /// Answer as JSON
    #[arg(long)]
    json: bool,
}

/// What came of it.
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
}

fn grid(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    match sides {
        Some((width @ 1..=MOST_RAYS, height @ 1..=MOST_RAYS)) => Ok((width, height)),
        _ => Err(format!("expected a grid such as 320x240, at most {MOST_RAYS}x{MOST_RAYS}")),
    }
}

/// One trace that is replayed.
struct Trace {
    path: PathBuf,
    recording: Option<Value>,
    recipe: Recipe,
    rows: Vec<EpisodeRows>,
}

impl ReplayArgs {
    /// Replays.
    ///
    /// # Errors
    /// When a trace cannot be read or does not say how its world was made, and whatever writing gives.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let traces = self.open()?;
        if traces.len() > 1 && (self.mcap.is_some() || self.recompute_visibility) {
            return Err(Failure::input("--mcap and --recompute-visibility take a single trace"));
        }
        self.check_targets(&traces)?;
        let mut answer = ReplayAnswer::default();
        for trace in &traces {
            self.replay(trace, &mut answer)?;
        }
        output::print(&answer, self.json)?;
        Ok(if answer.divergences.is_empty() { Outcome::Done } else { Outcome::CheckFailed })
    }

    fn open(&self) -> Result<Vec<Trace>, Failure> {
        let files = inputs::resolve(&self.traces, io::stdin()).map_err(Failure::input)?;
        let set = TraceSet::open(&files).map_err(Failure::input)?;
        let mut traces = Vec::new();
        for (input, file) in files.iter().zip(set.files()) {
            let recording = file.metadata_value(RECORDING_KEY).and_then(|text| serde_json::from_str(text).ok());
            let recipe = Recipe::of(recording.as_ref())
                .map_err(|error| Failure::input(format!("`{}`: {error}", file.name())))?;
            let mut rows = merge::read(&input.path).map_err(Failure::input)?;
            if let Some(id) = &self.episode {
                rows.retain(|episode| episode.episode_id == *id);
            }
            traces.push(Trace { path: input.path.clone(), recording, recipe, rows });
        }
        if traces.iter().all(|trace| trace.rows.is_empty()) {
            let id = self.episode.as_deref().unwrap_or_default();
            return Err(Failure::input(format!(
                "no trace has the episode `{id}`; `mirrorstats info` lists what is there"
            )));
        }
        Ok(traces)
    }

    /// That no output is a trace that is read, and that no episode is lost with a log that is there.
    fn check_targets(&self, traces: &[Trace]) -> Result<(), Failure> {
        for (option, target) in [("--mcap", &self.mcap), ("--out", &self.out)] {
            let is_trace = |target: &PathBuf| traces.iter().any(|trace| is_same_file(target, &trace.path));
            if target.as_ref().is_some_and(is_trace) {
                return Err(Failure::input(format!("{option} is the trace itself; name another file")));
            }
        }
        if self.mcap.is_some() && self.mcap == self.out {
            return Err(Failure::input("--mcap and --out: expected two files, found one name"));
        }
        for (folder, trace) in self.frames.iter().flat_map(|folder| traces.iter().map(move |trace| (folder, trace))) {
            for (rows, t) in trace.rows.iter().flat_map(|rows| (1..=rows.len()).map(move |t| (rows, t))) {
                output::check_target(&frame_path(folder, &rows.episode_id, t), traces.iter().map(|trace| &trace.path))?;
            }
        }
        self.check_log()
    }

    /// That a log which is there holds no episode that this replay leaves out.
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

    /// The configuration of the eye: the recorded one, or what was asked for.
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

    fn replay(&self, trace: &Trace, answer: &mut ReplayAnswer) -> Result<(), Failure> {
        let eye = self.eye(&trace.recipe);
        let mut renderer = if self.frames.is_some() || self.mcap.is_some() {
            Some(Eye::new(&trace.recipe.config).map_err(Failure::input)?)
        } else {
            None
        };
        let parts = tempfile::tempdir().map_err(Failure::Output)?;
        let (mut logs, mut rewritten) = (Vec::new(), Vec::new());
        for rows in &trace.rows {
            let episode = rows.episode().map_err(Failure::input)?;
            let part = parts.path().join(format!("{}.mcap", logs.len()));
            let played = self.episode(&trace.recipe, &eye, &episode, renderer.as_mut(), &part)?;
            answer.episodes += 1;
            answer.steps += episode.steps.len();
            answer.divergences.extend(played.divergence);
            let place: Place = (episode.seed, episode.run);
            logs.push((place, part));
            if self.recompute_visibility {
                answer.flipped = Some(answer.flipped.unwrap_or(0) + played.counts.flipped(&episode));
                rewritten.push(rows.with_columns(&played.counts.columns()).map_err(Failure::input)?);
            }
        }
        if let Some(path) = &self.mcap {
            let recording = trace.recording.clone().unwrap_or(Value::Null);
            assemble::write(path, &logs, &recording).map_err(Failure::input)?;
        }
        if let (true, Some(path)) = (self.recompute_visibility, &self.out) {
            merge::write(path, Some(&recounted(trace.recording.as_ref(), &eye)), &rewritten).map_err(Failure::input)?;
        }
        Ok(())
    }

    fn episode(
        &self,
        recipe: &Recipe,
        eye: &WorldConfig,
        episode: &Episode,
        mut renderer: Option<&mut Eye>,
        part: &Path,
    ) -> Result<Played, Failure> {
        let key = key(episode)?;
        let mut log = match &self.mcap {
            Some(_) => Some(Log::begin_at(part, key, episode).map_err(|error| Failure::input(error.to_string()))?),
            None => None,
        };
        let mut counts = Counts::default();
        let divergence = again(recipe, eye, episode, |t, world, census, step| {
            counts.add(census, world.is_mirror_visible(census));
            let frame = renderer.as_mut().map(|renderer| renderer.frame(world)).transpose().map_err(Failure::input)?;
            let frame = frame.map(Arc::new);
            if let (Some(folder), Some(frame)) = (&self.frames, &frame) {
                save(&frame_path(folder, &episode.episode_id, t), frame)?;
            }
            if let Some(log) = &mut log {
                let seen = Seen { t, world, frame: frame.as_ref(), census };
                log.seen(&seen).and_then(|()| log.done(t, step)).map_err(|error| Failure::input(error.to_string()))?;
            }
            Ok::<(), Failure>(())
        })?;
        if let Some(log) = log {
            log.end(episode).map_err(|error| Failure::input(error.to_string()))?;
        }
        Ok(Played { divergence, counts })
    }
}

impl From<ReplayError> for Failure {
    fn from(error: ReplayError) -> Self {
        Self::input(error)
    }
}

struct Played {
    divergence: Option<Divergence>,
    counts: Counts,
}

/// What was counted anew, a value a step.
#[derive(Default)]
struct Counts {
    own: Vec<i32>,
    other: Vec<i32>,
    mirror: Vec<i32>,
    direct: Vec<i32>,
    visible: Vec<bool>,
}

impl Counts {
    fn add(&mut self, census: &crate::sim::census::Census, visible: bool) {
        let px = |count: u32| i32::try_from(count).unwrap_or(i32::MAX);
        self.own.push(px(census.self_px));
        self.other.push(px(census.other_px));
        self.mirror.push(px(census.mirror_px));
        self.direct.push(px(census.direct_other_px));
        self.visible.push(visible);
    }

    fn flipped(&self, episode: &Episode) -> usize {
        episode.steps.iter().zip(&self.visible).filter(|(step, visible)| step.mirror_visible != **visible).count()
    }

    fn columns(&self) -> [(&'static str, ArrayRef); 5] {
        let ints = |values: &[i32]| -> ArrayRef { Arc::new(Int32Array::from(values.to_vec())) };
        [
            ("mirror_self_px", ints(&self.own)),
            ("mirror_other_px", ints(&self.other)),
            ("mirror_px", ints(&self.mirror)),
            ("direct_other_px", ints(&self.direct)),
            ("mirror_visible", Arc::new(BooleanArray::from(self.visible.clone()))),
        ]
    }
}

fn key(episode: &Episode) -> Result<Key, Failure> {
    let experiment = Experiment::parse(&episode.experiment).map_err(Failure::input)?;
    Ok(Key { experiment, seed: episode.seed, run: episode.run })
}

/// The metadata of a trace whose visibility was decided anew. The world stays: it is what a replay builds.
fn recounted(recording: Option<&Value>, eye: &WorldConfig) -> Value {
    let mut recording = recording.cloned().unwrap_or_else(|| json!({}));
    recording["visibility_threshold_px"] = json!(eye.evidence.mirror_self_px);
    recording["visibility_grid"] = json!({ "width": eye.eye.width, "height": eye.eye.height_px });
    recording
}

/// Where the frame of a step goes.
fn frame_path(folder: &Path, episode_id: &str, t: impl fmt::Display) -> PathBuf {
    folder.join(episode_id.replace('/', "-")).join(format!("t{t:0>3}.png"))
}

fn save(path: &Path, frame: &Frame) -> Result<(), Failure> {
    let folder = replace::folder_of(path);
    fs::create_dir_all(folder)
        .map_err(|error| Failure::input(format!("cannot make the folder `{}`: {error}", folder.display())))?;
    output::write_file(path, frame.to_png().map_err(Failure::input)?)
}

impl fmt::Display for ReplayAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Divergence { episode_id, t, column, expected, found } in &self.divergences {
            writeln!(f, "{episode_id}, t = {t}: {column}: recorded {expected}, replayed {found}")?;
        }
        write!(f, "{}, {} replayed", counted(self.episodes as u64, "episode"), counted(self.steps as u64, "step"))?;
        match self.divergences.len() {
            0 => write!(f, ": all match")?,
            1 => write!(f, ": 1 of the episodes parts from the trace")?,
            parted => write!(f, ": {parted} of the episodes part from the trace")?,
        }
        match self.flipped {
            Some(flipped) => writeln!(f, "; mirror_visible is another at {}", counted(flipped as u64, "step")),
            None => writeln!(f),
        }
    }
}
