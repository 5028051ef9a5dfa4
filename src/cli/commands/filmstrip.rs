//! `mirrorstats filmstrip`: one episode as a row of frames.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::log::message::EpisodeMessage;
use crate::log::read::{Event, LogReader, png};
use crate::replay::again::{Recipe, again};
use crate::replay::moments::{chosen, moments};
use crate::report::figures::Figure;
use crate::report::figures::film_strip::{Still, film_strip};
use crate::sim::eye::Eye;
use crate::trace::episode::{Episode, Step};
use crate::trace::inputs;
use crate::trace::merge;
use crate::trace::open::TraceSet;
use crate::trace::schema::RECORDING_KEY;

/// Draw one episode as a row of frames: what was done and claimed at each, and when the mirror was in view
///
/// Frames come from a log, or are rendered again from a trace. First sight, first claim and decision are marked.
#[derive(Clone, Debug, clap::Args)]
pub struct FilmstripArgs {
    /// The episode's id, such as E1/oracle/s1/r1
    #[arg(value_name = "EPISODE")]
    episode: String,
    /// Logs or traces to look for it in: files, folders or quoted globs
    #[arg(value_name = "RECORDINGS", default_value = "runs")]
    recordings: Vec<String>,
    /// The picture to write: .png, .svg or .pdf
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    /// How many frames
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=20))]
    count: u16,
    /// These steps instead of chosen ones
    #[arg(long, value_name = "T,T,..", value_delimiter = ',', conflicts_with = "count")]
    steps: Option<Vec<i32>>,
}

/// An episode and the frames of some of its steps, PNG.
struct Reel {
    episode: Episode,
    frames: BTreeMap<i32, Vec<u8>>,
}

impl FilmstripArgs {
    /// Draws.
    ///
    /// # Errors
    /// When the episode is nowhere, a step is not in it, its frames are not to be had, or the file cannot be written.
    pub fn run(&self) -> Result<Outcome, Failure> {
        let ending = self.out.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_owned();
        if !["png", "svg", "pdf"].contains(&ending.as_str()) {
            return Err(Failure::input("--out: expected a file that ends in .png, .svg or .pdf"));
        }
        let reel = self.reel()?;
        let moments = moments(&reel.episode);
        let mut stills = Vec::new();
        for t in self.chosen(&reel.episode)? {
            let step = usize::try_from(t - 1).ok().and_then(|at| reel.episode.steps.get(at));
            let (Some(step), Some(png)) = (step, reel.frames.get(&t)) else {
                return Err(Failure::input(format!("`{}` has no frame of step {t}", self.episode)));
            };
            let moments = moments.iter().filter(|(at, _)| *at == t).map(|(_, moment)| moment.title()).collect();
            stills.push(still(t, step, png, moments)?);
        }
        let figure = film_strip(&title(&reel.episode), &stills);
        output::write_file(&self.out, &bytes(&figure, &ending)?)?;
        Ok(Outcome::Done)
    }

    fn chosen(&self, episode: &Episode) -> Result<Vec<i32>, Failure> {
        let Some(steps) = &self.steps else { return Ok(chosen(episode, usize::from(self.count))) };
        let last = i32::try_from(episode.steps.len()).unwrap_or(i32::MAX);
        match steps.iter().find(|t| !(1..=last).contains(*t)) {
            Some(t) => Err(Failure::input(format!("`{}` has steps 1 to {last}, found {t}", self.episode))),
            None => Ok(steps.clone()),
        }
    }

    /// Looks for the episode in logs first: frames are there.
    fn reel(&self) -> Result<Reel, Failure> {
        let (logs, traces) = self.sources()?;
        output::check_target(&self.out, &logs)?;
        for log in &logs {
            if let Some(reel) = self.in_log(log)? {
                return Ok(reel);
            }
        }
        if !traces.is_empty()
            && let Some(reel) = self.in_traces(&traces)?
        {
            return Ok(reel);
        }
        let places = self.recordings.join(", ");
        Err(Failure::input(format!(
            "no log or trace in {places} has the episode `{}`; `mirrorstats info` lists episodes",
            self.episode
        )))
    }

    fn sources(&self) -> Result<(Vec<PathBuf>, Vec<String>), Failure> {
        let (mut logs, mut traces) = (Vec::new(), Vec::new());
        for named in &self.recordings {
            let path = Path::new(named);
            if path.extension().is_some_and(|ending| ending == "mcap") {
                logs.push(path.to_owned());
            } else if path.is_dir() {
                let entries = std::fs::read_dir(path)
                    .map_err(|error| Failure::input(format!("cannot read `{named}`: {error}")))?;
                let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
                found.sort();
                logs.extend(
                    found.iter().filter(|path| path.extension().is_some_and(|ending| ending == "mcap")).cloned(),
                );
                if found.iter().any(|path| path.extension().is_some_and(|ending| ending == "parquet")) {
                    traces.push(named.clone());
                }
            } else {
                traces.push(named.clone());
            }
        }
        Ok((logs, traces))
    }

    fn in_log(&self, path: &Path) -> Result<Option<Reel>, Failure> {
        let mut head = None;
        let (mut steps, mut frames) = (Vec::new(), BTreeMap::new());
        for message in LogReader::open(path).map_err(Failure::input)? {
            let message = message.map_err(Failure::input)?;
            match message.event {
                Event::Episode(EpisodeMessage::Begin(found)) if found.episode_id == self.episode => head = Some(found),
                Event::Episode(EpisodeMessage::End { .. }) if head.is_some() => break,
                Event::Frame(image) if head.is_some() => {
                    let t = i32::try_from(steps.len() + 1).unwrap_or(i32::MAX);
                    frames.extend(png(&image).map(|png| (t, png)));
                }
                Event::Decision(row) if head.is_some() => steps.push(row.into_step().map_err(Failure::input)?),
                _ => {}
            }
        }
        // A log without frames tells the story, but shows nothing: the trace renders it again.
        Ok(head.filter(|_| !frames.is_empty()).map(|head| Reel { episode: Episode { steps, ..head }, frames }))
    }

    fn in_traces(&self, traces: &[String]) -> Result<Option<Reel>, Failure> {
        let files = inputs::resolve(traces, io::stdin()).map_err(Failure::input)?;
        output::check_target(&self.out, files.iter().map(|file| &file.path))?;
        let set = TraceSet::open(&files).map_err(Failure::input)?;
        for (input, file) in files.iter().zip(set.files()) {
            let rows = merge::read(&input.path).map_err(Failure::input)?;
            let Some(found) = rows.iter().find(|rows| rows.episode_id == self.episode) else { continue };
            let recording = file.metadata_value(RECORDING_KEY).and_then(|text| serde_json::from_str(text).ok());
            let recipe = Recipe::of(recording.as_ref())?;
            let episode = found.episode().map_err(Failure::input)?;
            return self.rendered(&recipe, episode).map(Some);
        }
        Ok(None)
    }

    fn rendered(&self, recipe: &Recipe, episode: Episode) -> Result<Reel, Failure> {
        let wanted = self.chosen(&episode)?;
        let mut eye = Eye::new(&recipe.config).map_err(Failure::input)?;
        let mut frames = BTreeMap::new();
        let divergence = again(recipe, &recipe.eye, &episode, |t, world, _, _| {
            if wanted.contains(&t) {
                let frame = eye.frame(world).map_err(Failure::input)?;
                frames.insert(t, frame.to_png().map_err(Failure::input)?.to_vec());
            }
            Ok::<(), Failure>(())
        })?;
        match divergence {
            None => Ok(Reel { episode, frames }),
            Some(parted) => Err(Failure::input(format!(
                "the episode cannot be rendered again: at t = {} `{}` was {}, and is {} now; take its log",
                parted.t, parted.column, parted.expected, parted.found
            ))),
        }
    }
}

fn title(episode: &Episode) -> String {
    let stated = episode.stated_color.as_ref().map_or(String::new(), |color| format!(", told {color}"));
    format!("{}: body {}{stated}", episode.episode_id, episode.body_color)
}

fn still(t: i32, step: &Step, png: &[u8], moments: Vec<&'static str>) -> Result<Still, Failure> {
    let fault = || Failure::input(format!("the frame of step {t} is no PNG"));
    // Width and height stand at fixed places behind the signature.
    let pixels = |at: usize| png.get(at..at + 4).and_then(|bytes| Some(u32::from_be_bytes(bytes.try_into().ok()?)));
    let size = (pixels(16).ok_or_else(fault)?, pixels(20).ok_or_else(fault)?);
    let action = step.action.map_or("no action", crate::trace::episode::Action::name).replace('_', " ");
    let action = match step.selected_cube.as_deref() {
        Some(cube) if cube != "none" => format!("{action}, takes {cube}"),
        _ => action,
    };
    let claim = step.self_color.as_ref().map_or("no claim".to_owned(), |color| format!("claims {color}"));
    Ok(Still { t, png: png.to_vec(), size, action, claim, visible: step.mirror_visible, moments })
}

fn bytes(figure: &Figure, ending: &str) -> Result<Vec<u8>, Failure> {
    match ending {
        #[cfg(feature = "raster")]
        "png" => figure.png().map_err(Failure::input),
        #[cfg(feature = "raster")]
        "pdf" => figure.pdf().map_err(Failure::input),
        "svg" => Ok(figure.svg().into_bytes()),
        other => Err(Failure::input(format!("this build writes no .{other}; build it with the feature `raster`"))),
    }
}
