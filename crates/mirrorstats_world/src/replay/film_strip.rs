//! One episode as a row of frames, from a log or rendered again from a trace.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::again::Recipe;
use super::error::ReplayError;
use super::frames::rendered;
use super::moments::{chosen, moments};
use mirrorstats_exact::budget::Limit;
use mirrorstats_figures::Figure;
use mirrorstats_figures::film_strip::{Still, film_strip};
use mirrorstats_trace::episodes::episode::{Action, Episode, Step};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::log::message::EpisodeMessage;
use mirrorstats_trace::log::read::{Event, LogReader, png};
use mirrorstats_trace::log::recover::ended;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::write::merge::{self, EpisodeRows};

/// The maximum pixels of a frame, 2048 x 2048: a small file may decode to many pixels of four bytes each.
const LARGEST_FRAME: Limit = Limit::new("pixels in a frame", 1 << 22);

#[derive(Clone, Debug)]
pub struct Strip {
    pub episode: String,
    pub steps: Steps,
}

#[derive(Clone, Debug)]
pub enum Steps {
    /// This number of steps, chosen to tell the story.
    Chosen(usize),
    Named(Vec<i32>),
}

/// An episode and the frames of some of its steps as PNG.
struct Reel {
    episode: Episode,
    frames: BTreeMap<i32, Vec<u8>>,
}

impl Strip {
    pub fn from_logs(&self, logs: &[PathBuf], traces: &[Input]) -> Result<Option<Figure>, ReplayError> {
        for log in logs {
            if let Some(reel) = self.in_log(log)? {
                self.check_traces(&reel.episode, log, traces)?;
                return self.draw(&reel).map(Some);
            }
        }
        Ok(None)
    }

    pub fn from_traces(&self, traces: &[Input]) -> Result<Option<Figure>, ReplayError> {
        self.in_traces(traces)?.map(|reel| self.draw(&reel)).transpose()
    }

    fn draw(&self, Reel { episode, frames }: &Reel) -> Result<Figure, ReplayError> {
        let moments = moments(episode);
        let mut stills = Vec::new();
        for t in self.chosen(episode)? {
            let step = usize::try_from(t - 1).ok().and_then(|at| episode.steps.get(at));
            let (Some(step), Some(png)) = (step, frames.get(&t)) else {
                return Err(ReplayError::NoFrame { episode: self.episode.clone(), t });
            };
            let moments = moments.iter().filter(|(at, _)| *at == t).map(|(_, moment)| moment.title()).collect();
            stills.push(still(t, step, png, moments)?);
        }
        Ok(film_strip(&title(episode), &stills))
    }

    fn chosen(&self, episode: &Episode) -> Result<Vec<i32>, ReplayError> {
        let last = i32::try_from(episode.steps.len()).unwrap_or(i32::MAX);
        match &self.steps {
            Steps::Chosen(count) => Ok(chosen(episode, *count)),
            Steps::Named(steps) => match steps.iter().find(|t| !(1..=last).contains(*t)) {
                Some(&t) => Err(ReplayError::NoStep { episode: self.episode.clone(), last, t }),
                None => Ok(steps.clone()),
            },
        }
    }

    fn in_log(&self, path: &Path) -> Result<Option<Reel>, ReplayError> {
        let (mut head, mut end) = (None, None);
        let (mut steps, mut frames) = (Vec::new(), BTreeMap::new());
        for message in LogReader::open(path).map_err(ReplayError::other)? {
            match message.map_err(ReplayError::other)?.event {
                Event::Episode(EpisodeMessage::Begin(found)) if found.episode_id == self.episode => head = Some(found),
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
            Ok(episode) => Ok(Some(Reel { episode, frames })),
            Err((episode, fault)) => {
                Err(ReplayError::InLog { log: path.to_owned(), episode: episode.episode_id, fault })
            }
        }
    }

    /// Rejects a trace whose rows of the episode differ from its log's. Unreadable traces are ignored.
    fn check_traces(&self, episode: &Episode, log: &Path, traces: &[Input]) -> Result<(), ReplayError> {
        let Some(logged) = &episode.episode_hash else { return Ok(()) };
        for trace in traces {
            let Ok(rows) = merge::read(&trace.path) else { continue };
            let found = rows.iter().find(|rows| rows.episode_id == self.episode);
            if let Some(traced) = found.and_then(EpisodeRows::stated_hash).filter(|traced| traced != logged) {
                return Err(ReplayError::apart(&self.episode, (&trace.name, &traced), (log, logged)));
            }
        }
        Ok(())
    }

    fn in_traces(&self, traces: &[Input]) -> Result<Option<Reel>, ReplayError> {
        let set = TraceSet::open(traces).map_err(ReplayError::other)?;
        let mut undrawable = None;
        for (input, file) in traces.iter().zip(set.files()) {
            // All rows are read at once, so a file that cannot be drawn is not read.
            let recipe = match Recipe::of(&file.recording()) {
                Ok(recipe) => recipe,
                Err(error) => {
                    undrawable.get_or_insert(error);
                    continue;
                }
            };
            let rows = merge::read(&input.path).map_err(ReplayError::other)?;
            let Some(found) = rows.iter().find(|rows| rows.episode_id == self.episode) else { continue };
            return self.rendered(&recipe, found.episode().map_err(ReplayError::other)?).map(Some);
        }
        undrawable.map_or(Ok(None), Err)
    }

    fn rendered(&self, recipe: &Recipe, episode: Episode) -> Result<Reel, ReplayError> {
        let wanted = self.chosen(&episode)?;
        let frames = rendered(recipe, &recipe.eye, &episode, i32::MAX, |t| wanted.contains(&t))?;
        Ok(Reel { episode, frames })
    }
}

fn title(episode: &Episode) -> String {
    let stated = episode.stated_color.as_ref().map_or(String::new(), |color| format!(", told {color}"));
    format!("{}: body {}{stated}", episode.episode_id, episode.body_color)
}

fn still(t: i32, step: &Step, png: &[u8], moments: Vec<&'static str>) -> Result<Still, ReplayError> {
    // Width and height are at fixed offsets behind the signature.
    let pixels = |at: usize| png.get(at..at + 4).and_then(|bytes| Some(u32::from_be_bytes(bytes.try_into().ok()?)));
    let (Some(width), Some(height)) = (pixels(16), pixels(20)) else { return Err(ReplayError::NotPng(t)) };
    LARGEST_FRAME.check(u64::from(width) * u64::from(height)).map_err(|exceeded| ReplayError::Frame(t, exceeded))?;
    let action = step.action.map_or("no action", Action::name).replace('_', " ");
    let action = match step.selected_cube.as_deref() {
        Some(cube) if cube != "none" => format!("{action}, takes {cube}"),
        _ => action,
    };
    let claim = match (&step.self_color, step.extra.target_distance) {
        (Some(color), _) => format!("claims {color}"),
        (None, Some(distance)) => format!("{distance} mm from the mark then"),
        (None, None) => "no claim".to_owned(),
    };
    Ok(Still { t, png: png.to_vec(), size: (width, height), action, claim, visible: step.mirror_visible, moments })
}

#[cfg(test)]
mod tests {
    use super::still;
    use mirrorstats_trace::episodes::episode::Step;

    #[test]
    fn a_frame_is_refused_before_its_pixels_are_made() {
        let png = |width: u32, height: u32| {
            let start = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".iter().copied();
            start.chain(width.to_be_bytes()).chain(height.to_be_bytes()).collect::<Vec<_>>()
        };
        assert!(still(1, &Step::default(), &png(2048, 2048), Vec::new()).is_ok());
        for (width, height) in [(60_000, 60_000), (2049, 2048), (u32::MAX, u32::MAX)] {
            let told = still(7, &Step::default(), &png(width, height), Vec::new()).unwrap_err().to_string();
            assert!(told.contains("step 7") && told.contains("4194304 pixels in a frame"), "{told}");
        }
    }
}
