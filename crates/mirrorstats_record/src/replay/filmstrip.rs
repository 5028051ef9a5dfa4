//! The frames of one episode for a film strip, from a log or rendered again from a trace.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use super::again::Recipe;
use super::error::ReplayError;
use super::frames::rendered;
use mirrorstats_exact::budget::Limit;
use mirrorstats_log::message::EpisodeMessage;
use mirrorstats_log::read::{Event, LogReader, png};
use mirrorstats_log::recover::ended;
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::episodes::moments::chosen;
use mirrorstats_trace::inputs::{self, Input};
use mirrorstats_trace::read::episode_rows::{self, EpisodeRows};
use mirrorstats_trace::read::open::TraceSet;

/// The maximum pixels of a frame, 2048 x 2048: a small file may decode to many pixels of four bytes each.
const LARGEST_FRAME: Limit = Limit::new("pixels in a frame", 1 << 22);

/// The logs and traces to search for an episode.
#[derive(Clone, Debug)]
pub struct RecordedFiles {
    named: Vec<OsString>,
    pub logs: Vec<PathBuf>,
    pub traces: Vec<Input>,
}

impl RecordedFiles {
    /// Those of files, folders and quoted globs; the logs of a folder are those directly in it.
    pub fn of(named: &[OsString]) -> Result<Self, ReplayError> {
        let (mut logs, mut traces) = (Vec::new(), Vec::new());
        for name in named {
            let path = Path::new(name);
            if path.is_dir() {
                let unreadable = |error| ReplayError::other(format!("cannot read `{}`: {error}", path.display()));
                let entries = std::fs::read_dir(path).map_err(unreadable)?;
                let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
                found.sort();
                traces.extend(found.iter().any(|path| ends_in(path, "parquet")).then(|| name.clone()));
                logs.extend(found.into_iter().filter(|path| ends_in(path, "mcap")));
            } else if ends_in(path, "mcap") {
                logs.push(path.to_owned());
            } else {
                traces.push(name.clone());
            }
        }
        let traces = if traces.is_empty() {
            Vec::new()
        } else {
            inputs::resolve(&traces, io::stdin()).map_err(ReplayError::other)?
        };
        Ok(Self { named: named.to_vec(), logs, traces })
    }

    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.logs.iter().chain(self.traces.iter().map(|trace| &trace.path))
    }

    /// The frames of an episode, from a log or else rendered from a trace; `count` steps, chosen to tell the story.
    pub fn reel(&self, episode: &str, count: usize) -> Result<Reel, ReplayError> {
        for log in &self.logs {
            if let Some((found, frames)) = in_log(log, episode)? {
                let reel = Reel::new(found, count, frames)?;
                self.check_traces(&reel.episode, log)?;
                return Ok(reel);
            }
        }
        let rendered = if self.traces.is_empty() { None } else { self.rendered(episode, count)? };
        rendered.ok_or_else(|| {
            let named: Vec<_> = self.named.iter().map(|named| named.to_string_lossy()).collect();
            ReplayError::other(format!(
                "no log or trace in {} has the episode `{episode}`; `mirrorstats trace info --episodes` lists those of traces",
                named.join(", ")
            ))
        })
    }

    /// Rejects a trace whose rows of the episode differ from its log's. Unreadable traces are ignored.
    fn check_traces(&self, episode: &Episode, log: &Path) -> Result<(), ReplayError> {
        let Some(logged) = &episode.episode_hash else { return Ok(()) };
        for trace in &self.traces {
            let Ok(rows) = episode_rows::read(&trace.path) else { continue };
            let found = rows.iter().find(|rows| rows.episode_id == episode.episode_id);
            if let Some(traced) = found.and_then(EpisodeRows::stated_hash).filter(|traced| traced != logged) {
                return Err(ReplayError::apart(&episode.episode_id, (&trace.name, &traced), (log, logged)));
            }
        }
        Ok(())
    }

    fn rendered(&self, episode: &str, count: usize) -> Result<Option<Reel>, ReplayError> {
        let set = TraceSet::open(&self.traces).map_err(ReplayError::other)?;
        let mut undrawable = None;
        for (input, file) in self.traces.iter().zip(set.files()) {
            // All rows are read at once, so a file that cannot be drawn is not read.
            let recipe = match Recipe::from_recording(&file.recording()) {
                Ok(recipe) => recipe,
                Err(error) => {
                    undrawable.get_or_insert(error);
                    continue;
                }
            };
            let rows = episode_rows::read(&input.path).map_err(ReplayError::other)?;
            let Some(found) = rows.iter().find(|rows| rows.episode_id == episode) else { continue };
            let episode = found.episode().map_err(ReplayError::other)?;
            let wanted = chosen(&episode, count);
            let frames = rendered(&recipe, &recipe.config, &episode, i32::MAX, |t| wanted.contains(&t))?;
            return Reel::new(episode, count, frames).map(Some);
        }
        undrawable.map_or(Ok(None), Err)
    }
}

fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|found| found == ending)
}

/// An episode and the frames of the chosen steps, in order.
#[derive(Clone, Debug)]
pub struct Reel {
    pub episode: Episode,
    pub frames: Vec<PngFrame>,
}

#[derive(Clone, Debug)]
pub struct PngFrame {
    pub t: i32,
    pub png: Vec<u8>,
    pub size: (u32, u32),
}

/// An episode of a log, and its frames as PNG by their steps.
type Filmed = (Episode, BTreeMap<i32, Vec<u8>>);

/// An episode of a log, and its frames by t; `None` if the log does not have both.
fn in_log(path: &Path, id: &str) -> Result<Option<Filmed>, ReplayError> {
    let (mut head, mut end) = (None, None);
    let (mut steps, mut frames) = (Vec::new(), BTreeMap::new());
    for message in LogReader::open(path).map_err(ReplayError::other)? {
        match message.map_err(ReplayError::other)?.event {
            Event::Episode(EpisodeMessage::Begin(found)) if found.episode_id == id => head = Some(found),
            Event::Episode(EpisodeMessage::End { fingerprint, episode_hash, .. }) if head.is_some() => {
                end = Some((fingerprint, episode_hash));
                break;
            }
            Event::Frame(image) if head.is_some() => {
                let t = i32::try_from(steps.len() + 1).unwrap_or(i32::MAX);
                frames.extend(png(&image).map(|png| (t, png)));
            }
            Event::Decision(row) if head.is_some() => steps.push(row.into_step().map_err(ReplayError::other)?),
            _ => {}
        }
    }
    // A log without frames has the moments but no pictures: the trace renders them again.
    let Some(head) = head.filter(|_| !frames.is_empty()) else { return Ok(None) };
    let (fingerprint, hash) = end.unwrap_or_default();
    match ended(*head, steps, fingerprint, hash) {
        Ok(episode) => Ok(Some((episode, frames))),
        Err((episode, fault)) => Err(ReplayError::InLog { log: path.to_owned(), episode: episode.episode_id, fault }),
    }
}

impl Reel {
    fn new(episode: Episode, count: usize, mut frames: BTreeMap<i32, Vec<u8>>) -> Result<Self, ReplayError> {
        let frame = |t| match frames.remove(&t) {
            Some(png) => PngFrame::new(t, png),
            None => Err(ReplayError::NoFrame { episode: episode.episode_id.clone(), t }),
        };
        let frames = chosen(&episode, count).into_iter().map(frame).collect::<Result<_, _>>()?;
        Ok(Self { episode, frames })
    }
}

impl PngFrame {
    fn new(t: i32, png: Vec<u8>) -> Result<Self, ReplayError> {
        // Width and height are at fixed offsets behind the signature.
        let pixels = |at: usize| png.get(at..at + 4).and_then(|bytes| Some(u32::from_be_bytes(bytes.try_into().ok()?)));
        let (Some(width), Some(height)) = (pixels(16), pixels(20)) else { return Err(ReplayError::NotPng(t)) };
        LARGEST_FRAME
            .check(u64::from(width) * u64::from(height))
            .map_err(|exceeded| ReplayError::Frame(t, exceeded))?;
        Ok(Self { t, png, size: (width, height) })
    }
}

#[cfg(test)]
mod tests {
    use super::PngFrame;

    #[test]
    fn a_frame_is_refused_before_its_pixels_are_made() {
        let png = |width: u32, height: u32| {
            let start = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".iter().copied();
            start.chain(width.to_be_bytes()).chain(height.to_be_bytes()).collect::<Vec<_>>()
        };
        assert!(PngFrame::new(1, png(2048, 2048)).is_ok());
        for (width, height) in [(60_000, 60_000), (2049, 2048), (u32::MAX, u32::MAX)] {
            let message = PngFrame::new(7, png(width, height)).unwrap_err().to_string();
            assert!(message.contains("step 7") && message.contains("4194304 pixels in a frame"), "{message}");
        }
    }
}
