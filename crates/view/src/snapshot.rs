//! The state of recordings at one time: their episodes, scores and locations.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::Options;
use super::error::ViewError;
use super::filter::Answers;
use super::found::{Found, Stamp};
use exact::escape::visible;
use study::{Outputs, Question, Results, Study};
use trace::episode::Episode;
use trace::inputs::Input;
use trace::log::LogError;
use trace::log::frames::{self, LogIndex, Moment, Shape};
use trace::merge::{self, EpisodeRows, OwnColumn};
use trace::scan::{EpisodePlace, episode_places};
use trace::schema::Domain;

/// The number of log indices in memory.
const KEPT_INDICES: usize = 64;

/// Recordings as of the time they were read.
#[derive(Debug)]
pub(super) struct Snapshot {
    /// Increases with each newer state.
    pub generation: u64,
    pub options: Options,
    /// The scores; `None` until an episode is finished.
    pub scored: Option<Arc<Scored>>,
    /// Episodes under way, by their logs.
    pub running: Vec<Running>,
    /// The reasons why other episodes under way cannot be shown.
    pub unreadable: Vec<String>,
    /// The stamps of the files.
    pub stamps: Vec<Stamp>,
    pub label_stamps: Vec<Stamp>,
    logs: Vec<PathBuf>,
    indices: Mutex<BTreeMap<PathBuf, Option<Arc<LogIndex>>>>,
    reading: Mutex<()>,
    pub answers: Answers,
    #[cfg(feature = "sim")]
    rendered: Arc<super::rendered::Rendered>,
}

#[derive(Debug)]
pub(super) struct Scored {
    pub study: Study,
    /// The episode table and related results.
    pub results: Results,
    /// The row of each episode in the table, by its id.
    pub rows: HashMap<String, usize>,
    pub inputs: Vec<Input>,
    places: HashMap<String, EpisodePlace>,
}

#[derive(Clone, Debug)]
pub(super) struct Running {
    pub log: PathBuf,
    /// Its steps so far.
    pub episode: Episode,
}

/// An episode, and whether it is still being recorded.
#[derive(Clone, Debug)]
pub(super) struct Opened {
    /// The episode, or its steps so far.
    pub episode: Episode,
    /// The log of an episode under way.
    pub running: Option<PathBuf>,
    pub input: Option<Input>,
    /// The columns of the steps if the trace is from another domain; the episode then has only identity and time.
    pub own: Option<Vec<OwnColumn>>,
}

/// Adjacent episodes of a trace, with their table rows and ids.
#[derive(Debug)]
pub(super) struct Together {
    pub input: Input,
    rows: Range<usize>,
    pub episodes: Vec<(usize, String)>,
}

impl Snapshot {
    /// Reads the current state of the recordings.
    pub fn open(options: &Options, generation: u64) -> Result<Self, ViewError> {
        Self::of_found(options, Found::of(&options.runs)?, generation)
    }

    /// The state of these files.
    pub fn of_found(options: &Options, found: Found, generation: u64) -> Result<Self, ViewError> {
        report::style::Style::load(&options.style).map_err(study::StudyError::from)?;
        let (stamps, label_stamps) = (found.stamps(), found.label_stamps());
        let scored = Self::scored(options, &found)?.map(Arc::new);
        let (running, unreadable) = running(&found, scored.as_deref());
        if scored.is_none() && running.is_empty() {
            let runs = options.runs.iter().map(|run| visible(&run.to_string_lossy())).collect::<Vec<_>>().join(", ");
            return Err(ViewError::Absent(format!(
                "{runs}: expected traces, or a recording that has begun, found no episode\n  help: `mirrorstats trace recover` makes \
                 a trace of a log"
            )));
        }
        Ok(Self {
            generation,
            options: options.clone(),
            scored,
            running,
            unreadable,
            stamps,
            label_stamps,
            logs: found.logs,
            indices: Mutex::default(),
            reading: Mutex::default(),
            answers: Answers::default(),
            #[cfg(feature = "sim")]
            rendered: Arc::default(),
        })
    }

    /// A copy with the current labels. Scores that depend on labels are computed again.
    pub fn relabelled(&self, found: &Found) -> Result<Self, ViewError> {
        match &self.scored {
            Some(scored) if !scored.study.reads_labels()? => {
                let scored = Arc::new(scored.relabelled(&self.options)?);
                Ok(Self { label_stamps: found.label_stamps(), ..self.grown(found, Some(scored)) })
            }
            _ => Self::open(&self.options, self.generation + 1),
        }
    }

    /// A copy with the current state of the episodes under way.
    pub fn grown(&self, found: &Found, scored: Option<Arc<Scored>>) -> Self {
        let (running, unreadable) = running(found, scored.as_deref());
        Self {
            generation: self.generation + 1,
            options: self.options.clone(),
            scored,
            running,
            unreadable,
            stamps: self.stamps.clone(),
            label_stamps: self.label_stamps.clone(),
            logs: self.logs.clone(),
            indices: Mutex::default(),
            reading: Mutex::default(),
            answers: Answers::default(),
            #[cfg(feature = "sim")]
            rendered: Arc::clone(&self.rendered),
        }
    }

    /// The steps of the episodes under way.
    pub fn steps_under_way(&self) -> u64 {
        self.running.iter().map(|running| running.episode.steps.len() as u64).sum()
    }

    fn scored(options: &Options, found: &Found) -> Result<Option<Scored>, ViewError> {
        let with_parts: Vec<Input> = found.traces.iter().chain(&found.parts).cloned().collect();
        if with_parts.is_empty() {
            return Ok(None);
        }
        match Scored::of(options, with_parts) {
            Err(_) if !found.parts.is_empty() && !found.traces.is_empty() => {
                Scored::of(options, found.traces.clone()).map(Some)
            }
            scored => scored.map(Some),
        }
    }

    /// The number of finished episodes.
    pub fn episodes(&self) -> usize {
        self.scored.as_ref().map_or(0, |scored| scored.results.episodes.len())
    }

    /// Returns true if the episode is present, finished or under way.
    pub fn has(&self, id: &str) -> bool {
        self.scored.as_ref().is_some_and(|scored| scored.rows.contains_key(id))
            || self.running.iter().any(|running| running.episode.episode_id == id)
    }

    /// The episodes with their scores.
    pub fn table(&self) -> Result<&Scored, ViewError> {
        self.scored.as_deref().ok_or_else(|| ViewError::Absent("no episode is whole yet".to_owned()))
    }

    /// The bytes of the files.
    pub fn bytes(&self) -> u64 {
        self.stamps.iter().map(|(_, bytes, _)| bytes).sum()
    }

    /// The number of values of all episodes: steps times columns.
    pub fn values(&self) -> Result<u64, ViewError> {
        let scored = self.table()?;
        let files = scored.study.traces()?.files();
        let episodes = scored.rows.keys().filter_map(|id| scored.places.get(id));
        Ok(episodes.map(|place| (place.rows.len() * files[place.file].columns().len()) as u64).sum())
    }

    /// All episodes, adjacent ones grouped up to a number of values and of episodes.
    pub fn together(&self, (values, count): (usize, usize)) -> Result<Vec<Together>, ViewError> {
        let scored = self.table()?;
        let files = scored.study.traces()?.files();
        let mut all: Vec<_> =
            scored.rows.iter().filter_map(|(id, row)| Some((scored.places.get(id)?, *row, id))).collect();
        all.sort_by_key(|(place, ..)| (place.file, place.rows.start));
        let mut found: Vec<(usize, Together)> = Vec::new();
        for (place, row, id) in all {
            let most = values / files[place.file].columns().len().max(1);
            match found.last_mut() {
                Some((file, some))
                    if *file == place.file
                        && some.rows.end == place.rows.start
                        && place.rows.end - some.rows.start <= most
                        && some.episodes.len() < count =>
                {
                    some.rows.end = place.rows.end;
                    some.episodes.push((row, id.clone()));
                }
                _ => {
                    let (input, rows) = (scored.inputs[place.file].clone(), place.rows.clone());
                    found.push((place.file, Together { input, rows, episodes: vec![(row, id.clone())] }));
                }
            }
        }
        Ok(found.into_iter().map(|(_, some)| some).collect())
    }

    /// Reads a group of episodes, in trace order.
    pub fn open_together(&self, some: &Together) -> Result<Vec<Opened>, ViewError> {
        let is_mirror = self.table()?.study.traces()?.domain() == Domain::Mirror;
        let rows = merge::read_rows(&some.input, some.rows.clone())?;
        if !rows.iter().map(|rows| &rows.episode_id).eq(some.episodes.iter().map(|(_, id)| id)) {
            return Err(replaced(&some.input));
        }
        rows.iter().map(|rows| opened(rows, &some.input, is_mirror)).collect()
    }

    /// An episode by its id.
    pub fn episode(&self, id: &str) -> Result<Opened, ViewError> {
        if let Some(scored) = &self.scored
            && let Some(place) = scored.places.get(id)
        {
            let input = &scored.inputs[place.file];
            let rows = merge::read_rows(input, place.rows.clone())?;
            let own = rows.iter().find(|rows| rows.episode_id == id).ok_or_else(|| replaced(input))?;
            return opened(own, input, scored.study.traces()?.domain() == Domain::Mirror);
        }
        // Reads the log again, since it grows.
        let own = self.running.iter().find(|running| running.episode.episode_id == id);
        let own = own.ok_or_else(|| ViewError::Absent(format!("no episode `{id}`")))?;
        let now = unfinished(&own.log)?.unwrap_or_else(|| own.episode.clone());
        Ok(Opened { episode: now, running: Some(own.log.clone()), input: None, own: None })
    }

    /// The log's record of a step.
    pub fn moment(&self, opened: &Opened, t: usize) -> Result<Option<Moment>, ViewError> {
        let Some(time) = time_of(&opened.episode, t) else { return Ok(None) };
        if let Some(log) = &opened.running {
            return Ok(frames::unfinished_step(log, time)?);
        }
        for log in self.logs_of(opened) {
            let Some(index) = self.index(log)? else { continue };
            if let Some(moment) = index.step(&opened.episode.episode_id, time)? {
                return Ok(Some(moment));
            }
        }
        Ok(None)
    }

    /// The frame of a step as PNG: from a log, or rendered again if no log has it and this build can.
    pub fn frame(&self, opened: &Opened, t: usize) -> Result<Option<Vec<u8>>, ViewError> {
        if let Some(frame) = self.moment(opened, t)?.and_then(|moment| moment.frame) {
            return Ok(Some(frame));
        }
        #[cfg(feature = "sim")]
        if self.renders(opened) {
            return self.rendered.frame(self.recording(opened).as_ref(), &opened.episode, t);
        }
        Ok(None)
    }

    /// Returns true if an episode's frames can be rendered again: the trace has its world, and this build has worlds.
    pub fn renders(&self, opened: &Opened) -> bool {
        let is_whole = self.scored.is_some() && opened.running.is_none();
        #[cfg(feature = "sim")]
        let has_world = world::replay::frames::is_recipe(self.recording(opened).as_ref());
        #[cfg(not(feature = "sim"))]
        let has_world = false;
        is_whole && has_world
    }

    #[cfg(feature = "sim")]
    fn recording(&self, opened: &Opened) -> Option<serde_json::Value> {
        let scored = self.scored.as_ref()?;
        let place = scored.places.get(&opened.episode.episode_id)?;
        let file = scored.study.traces().ok()?.files().get(place.file)?;
        serde_json::from_str(file.metadata_value(trace::schema::RECORDING_KEY)?).ok()
    }

    /// Passes the shapes of each step with its t; no calls without a log. Only one log at a time is read for shapes.
    pub fn each_shapes(&self, opened: &Opened, give: &mut dyn FnMut(usize, Vec<Shape>)) -> Result<(), LogError> {
        let _one = self.reading.lock().unwrap_or_else(PoisonError::into_inner);
        let times: BTreeMap<u64, usize> =
            (1..=opened.episode.steps.len()).filter_map(|t| Some((time_of(&opened.episode, t)?, t))).collect();
        let is_found = Cell::new(false);
        let mut give = |time: u64, shapes: Vec<Shape>| {
            if let Some(t) = times.get(&time) {
                is_found.set(true);
                give(*t, shapes);
            }
        };
        if let Some(log) = &opened.running {
            return frames::each_unfinished_shapes(log, &mut give);
        }
        let wanted: BTreeSet<u64> = times.keys().copied().collect();
        for log in self.logs_of(opened) {
            let Some(index) = self.index(log)? else { continue };
            index.each_shapes(&opened.episode.episode_id, &wanted, &mut give)?;
            if is_found.get() {
                break;
            }
        }
        Ok(())
    }

    /// Passes the log's record of each step of a finished episode, reading the log once.
    pub fn each_moment(&self, opened: &Opened, give: &mut dyn FnMut(usize, Moment)) -> Result<(), LogError> {
        let times: BTreeMap<u64, usize> =
            (1..=opened.episode.steps.len()).filter_map(|t| Some((time_of(&opened.episode, t)?, t))).collect();
        let wanted: BTreeSet<u64> = times.keys().copied().collect();
        let found = Cell::new(false);
        for log in self.logs_of(opened) {
            let Some(index) = self.index(log)? else { continue };
            index.each_moment(&opened.episode.episode_id, &wanted, &mut |time, moment| {
                found.set(true);
                if let Some(t) = times.get(&time) {
                    give(*t, moment);
                }
            })?;
            if found.get() {
                break;
            }
        }
        Ok(())
    }

    fn logs_of(&self, opened: &Opened) -> impl Iterator<Item = &PathBuf> {
        let beside = opened.input.as_ref().map(|input| input.path.with_extension("mcap"));
        let own = self.logs.iter().find(|log| Some(*log) == beside.as_ref());
        let others = if own.is_none() { self.logs.as_slice() } else { &[] };
        own.into_iter().chain(others)
    }

    /// The index of a log, read once; `None` if it has no index or is not the log of a recording.
    fn index(&self, log: &Path) -> Result<Option<Arc<LogIndex>>, LogError> {
        let mut indices = self.indices.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(index) = indices.get(log) {
            return Ok(index.clone());
        }
        if indices.len() >= KEPT_INDICES {
            indices.clear();
        }
        let index = match LogIndex::open(log) {
            Err(LogError::Foreign { .. }) => None,
            opened => opened?.map(Arc::new),
        };
        indices.insert(log.to_owned(), index.clone());
        Ok(index)
    }
}

impl Scored {
    fn of(options: &Options, inputs: Vec<Input>) -> Result<Self, ViewError> {
        let study = Self::study(options, inputs.clone(), options.question.clone())?;
        let places = episode_places(study.traces()?, options.threads)?;
        let outputs = Outputs { losses: true, quality: true, hashes: false, ..Outputs::default() };
        let results = study.scan(outputs)?;
        let rows = results.episodes.keys.iter().enumerate().map(|(at, key)| (key.episode_id.to_owned(), at)).collect();
        Ok(Self { study, results, rows, inputs, places })
    }

    /// The trace of an episode, and the number of its steps.
    pub fn place(&self, id: &str) -> Option<(&Input, usize)> {
        let place = self.places.get(id).filter(|_| self.rows.contains_key(id))?;
        Some((&self.inputs[place.file], place.rows.len()))
    }

    /// A copy with the current labels.
    fn relabelled(&self, options: &Options) -> Result<Self, ViewError> {
        let study = Self::study(options, self.inputs.clone(), options.question.clone())?;
        let results = study.relabelled(self.results.clone())?;
        let (rows, inputs, places) = (self.rows.clone(), self.inputs.clone(), self.places.clone());
        Ok(Self { study, results, rows, inputs, places })
    }

    /// A study of these files with another question.
    pub fn study(options: &Options, inputs: Vec<Input>, question: Question) -> Result<Study, ViewError> {
        Ok(Study::of(inputs)?.threads(options.threads).asked(question)?)
    }
}

fn replaced(input: &Input) -> ViewError {
    ViewError::Absent(format!("`{}` was replaced; load the page again", input.name))
}

fn opened(rows: &EpisodeRows, input: &Input, is_mirror: bool) -> Result<Opened, ViewError> {
    let episode = if is_mirror { rows.episode() } else { rows.identity() };
    let episode = episode.map_err(|fault| ViewError::Absent(format!("`{}`: {fault}", input.name)))?;
    let own = (!is_mirror).then(|| rows.own_columns());
    Ok(Opened { episode, running: None, input: Some(input.clone()), own })
}

fn time_of(episode: &Episode, t: usize) -> Option<u64> {
    let step = episode.steps.get(t.checked_sub(1)?)?;
    u64::try_from(step.extra.frame_time?).ok()
}

fn unfinished(log: &Path) -> Result<Option<Episode>, LogError> {
    match frames::unfinished(log) {
        Err(LogError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        read => Ok(read?.map(|found| found.episode)),
    }
}

/// The episodes under way, and the reasons why others cannot be read; finished episodes are left out.
fn running(found: &Found, scored: Option<&Scored>) -> (Vec<Running>, Vec<String>) {
    let (mut running, mut unreadable) = (Vec::new(), Vec::new());
    for log in &found.unfinished {
        match unfinished(log) {
            Ok(Some(episode)) => running.push(Running { log: log.clone(), episode }),
            Ok(None) => {}
            Err(error) => unreadable.push(ViewError::from(error).words()),
        }
    }
    running.retain(|running| scored.is_none_or(|scored| !scored.rows.contains_key(&running.episode.episode_id)));
    running.sort_by(|a, b| a.episode.episode_id.cmp(&b.episode.episode_id));
    running.dedup_by(|a, b| a.episode.episode_id == b.episode.episode_id);
    (running, unreadable)
}
