//! The state of recordings at one time: their episodes, scores and locations.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::found::{Found, Stamp};
use super::logs::{Logs, Opened};
use super::recent::Recent;
use super::{Options, ViewError};
use mirrorstats_exact::escape::visible;
use mirrorstats_log::LogError;
use mirrorstats_log::frames;
use mirrorstats_score::tables::select::{SelectError, select};
use mirrorstats_study::labels::{reads_labels, relabelled};
use mirrorstats_study::question::Question;
use mirrorstats_study::results::{Outputs, Results};
use mirrorstats_study::{Study, StudyError};
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::{self, EpisodeRows};
use mirrorstats_trace::read::search;
use mirrorstats_trace::scan::{EpisodePlace, episode_places};
use mirrorstats_trace::schema::Domain;

/// The number of conditions, and of searches, whose answers are kept: each took a scan.
const MOST_ANSWERS: usize = 4;

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
    pub stamps: Vec<Stamp>,
    pub label_stamps: Vec<Stamp>,
    pub logs: Logs,
    kept: Recent<String, HashSet<String>>,
    said: Recent<String, BTreeMap<String, search::Found>>,
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

/// Adjacent episodes of a trace, with their table rows and ids.
#[derive(Debug)]
pub(super) struct Together {
    pub input: Input,
    rows: Range<usize>,
    pub episodes: Vec<(usize, String)>,
}

impl Snapshot {
    pub fn open(options: &Options, generation: u64) -> Result<Self, ViewError> {
        Self::of_found(options, &Found::of(&options.runs)?, generation)
    }

    pub fn of_found(options: &Options, found: &Found, generation: u64) -> Result<Self, ViewError> {
        mirrorstats_report::style::Style::load(&options.style).map_err(StudyError::from)?;
        let stamps = (found.stamps(), found.label_stamps());
        let scored = Self::scored(options, found)?.map(Arc::new);
        let snapshot = Self::new(options, found, scored, generation, stamps);
        if snapshot.scored.is_none() && snapshot.running.is_empty() {
            let runs = options.runs.iter().map(|run| visible(&run.to_string_lossy())).collect::<Vec<_>>().join(", ");
            return Err(ViewError::Absent(format!(
                "{runs}: expected traces, or a recording that has begun, found no episode\n  help: `mirrorstats trace recover` makes \
                 a trace of a log"
            )));
        }
        Ok(snapshot)
    }

    /// `stamps` are those of the traces and logs, and those of the labels.
    fn new(
        options: &Options,
        found: &Found,
        scored: Option<Arc<Scored>>,
        generation: u64,
        (stamps, label_stamps): (Vec<Stamp>, Vec<Stamp>),
    ) -> Self {
        let (running, unreadable) = running(found, scored.as_deref());
        Self {
            generation,
            options: options.clone(),
            scored,
            running,
            unreadable,
            stamps,
            label_stamps,
            logs: Logs::new(found.logs.clone()),
            kept: Recent::new(MOST_ANSWERS),
            said: Recent::new(MOST_ANSWERS),
            #[cfg(feature = "sim")]
            rendered: Arc::default(),
        }
    }

    /// A copy with the current labels. Scores that depend on labels are computed again.
    pub fn relabelled(&self, found: &Found) -> Result<Self, ViewError> {
        match &self.scored {
            Some(scored) if !reads_labels(&scored.study)? => {
                let scored = Arc::new(scored.relabelled(&self.options)?);
                Ok(Self { label_stamps: found.label_stamps(), ..self.grown(found, Some(scored)) })
            }
            _ => Self::open(&self.options, self.generation + 1),
        }
    }

    /// A copy with the current state of the episodes under way.
    pub fn grown(&self, found: &Found, scored: Option<Arc<Scored>>) -> Self {
        let stamps = (self.stamps.clone(), self.label_stamps.clone());
        Self {
            #[cfg(feature = "sim")]
            rendered: Arc::clone(&self.rendered),
            ..Self::new(&self.options, found, scored, self.generation + 1, stamps)
        }
    }

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
        let rows = episode_rows::read_rows(&some.input, some.rows.clone())?;
        if !rows.iter().map(|rows| &rows.episode_id).eq(some.episodes.iter().map(|(_, id)| id)) {
            return Err(replaced(&some.input));
        }
        rows.iter().map(|rows| opened(rows, &some.input, is_mirror)).collect()
    }

    pub fn episode(&self, id: &str) -> Result<Opened, ViewError> {
        if let Some(scored) = &self.scored
            && let Some(place) = scored.places.get(id)
        {
            let input = &scored.inputs[place.file];
            let rows = episode_rows::read_rows(input, place.rows.clone())?;
            let own = rows.iter().find(|rows| rows.episode_id == id).ok_or_else(|| replaced(input))?;
            return opened(own, input, scored.study.traces()?.domain() == Domain::Mirror);
        }
        // Reads the log again, since it grows.
        let own = self.running.iter().find(|running| running.episode.episode_id == id);
        let own = own.ok_or_else(|| ViewError::Absent(format!("no episode `{id}`")))?;
        let now = unfinished(&own.log)?.unwrap_or_else(|| own.episode.clone());
        Ok(Opened { episode: now, running: Some(own.log.clone()), input: None, own: None })
    }

    /// The frame of a step as PNG: from a log, or rendered again if no log has it and this build can.
    pub fn frame(&self, opened: &Opened, t: usize) -> Result<Option<Vec<u8>>, ViewError> {
        if let Some(frame) = self.logs.moment(opened, t)?.and_then(|moment| moment.frame) {
            return Ok(Some(frame));
        }
        #[cfg(feature = "sim")]
        if self.renders(opened) {
            return self.rendered.frame(self.recording(opened).as_ref(), &opened.episode, t);
        }
        Ok(None)
    }

    /// Passes the shapes of each step with its t: from a log, or from a replay if no log has them and this build can.
    pub fn each_shapes(
        &self,
        opened: &Opened,
        give: &mut dyn FnMut(usize, &[frames::SceneShape]),
    ) -> Result<(), ViewError> {
        #[cfg(feature = "sim")]
        if self.renders(opened) && self.logs.moment(opened, 1)?.is_none() {
            let mut give = |t, solids: &[_]| give(t, &frames::of_solids(solids));
            let recording = self.recording(opened);
            let shown = mirrorstats_record::replay::frames::shapes(recording.as_ref(), &opened.episode, &mut give);
            return Ok(shown.map_err(Box::new)?);
        }
        Ok(self.logs.each_shapes(opened, &mut |t, shapes| give(t, &shapes))?)
    }

    /// Returns true if an episode's frames can be rendered again: the trace has its world, and this build has worlds.
    pub fn renders(&self, opened: &Opened) -> bool {
        let is_whole = self.scored.is_some() && opened.running.is_none();
        #[cfg(feature = "sim")]
        let has_world = mirrorstats_record::replay::frames::is_recipe(self.recording(opened).as_ref());
        #[cfg(not(feature = "sim"))]
        let has_world = false;
        is_whole && has_world
    }

    pub fn recording(&self, opened: &Opened) -> Option<serde_json::Value> {
        let scored = self.scored.as_ref()?;
        let place = scored.places.get(&opened.episode.episode_id)?;
        let file = scored.study.traces().ok()?.files().get(place.file)?;
        serde_json::from_str(file.metadata_value(mirrorstats_trace::schema::RECORDING_KEY)?).ok()
    }

    /// The episodes that satisfy a condition. Recent results are kept, since a condition on steps takes a scan.
    pub fn kept(&self, condition: &str) -> Result<Arc<HashSet<String>>, ViewError> {
        let scored = self.table()?;
        let found = || {
            let table = match select(scored.results.episodes.clone(), None, Some(condition)) {
                Ok(table) => table,
                Err(SelectError::Condition(_)) => {
                    let options = &self.options;
                    let question = Question { filter: Some(condition.to_owned()), ..options.question.clone() };
                    Scored::study(options, scored.inputs.clone(), question)?.score()?.episodes
                }
                Err(error) => return Err(StudyError::from(error).into()),
            };
            Ok(table.keys.iter().map(|key| key.episode_id.to_owned()).collect())
        };
        self.kept.get(condition.to_owned(), found)
    }

    /// The episodes whose texts contain these words.
    pub fn said(&self, words: &str) -> Result<Arc<BTreeMap<String, search::Found>>, ViewError> {
        let scored = self.table()?;
        self.said.get(words.to_owned(), || Ok(search::search(scored.study.traces()?, words, self.options.threads)?))
    }
}

impl Scored {
    fn of(options: &Options, inputs: Vec<Input>) -> Result<Self, ViewError> {
        let study = Self::study(options, inputs.clone(), options.question.clone())?;
        let places = episode_places(study.traces()?, options.threads)?;
        let outputs = Outputs { quality: true, copy_candidates: true, ..Outputs::default() };
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
        let results = relabelled(&study, self.results.clone())?;
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

fn unfinished(log: &Path) -> Result<Option<Episode>, LogError> {
    match frames::unfinished(log) {
        Err(LogError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        read => read,
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
