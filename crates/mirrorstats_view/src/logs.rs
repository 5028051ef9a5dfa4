//! The logs of recordings: what they have of an episode's steps.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use super::recent::Recent;
use mirrorstats_log::LogError;
use mirrorstats_log::frames::{self, LogIndex, Moment, SceneShape};
use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::episode_rows::OwnColumn;

/// The number of log indices in memory.
const KEPT_INDICES: usize = 64;

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

impl Opened {
    fn time_of(&self, t: usize) -> Option<u64> {
        let step = self.episode.steps.get(t.checked_sub(1)?)?;
        u64::try_from(step.extra.frame_time?).ok()
    }

    /// The steps by the times of their frames, ns.
    fn times(&self) -> BTreeMap<u64, usize> {
        (1..=self.episode.steps.len()).filter_map(|t| Some((self.time_of(t)?, t))).collect()
    }
}

/// Finished logs, and the recently used indices of them.
#[derive(Debug)]
pub(super) struct Logs {
    pub paths: Vec<PathBuf>,
    indices: Recent<PathBuf, Option<LogIndex>>,
    reading: Mutex<()>,
}

impl Logs {
    pub fn new(paths: Vec<PathBuf>) -> Self {
        Self { paths, indices: Recent::new(KEPT_INDICES), reading: Mutex::default() }
    }

    /// The log's record of a step.
    pub fn moment(&self, opened: &Opened, t: usize) -> Result<Option<Moment>, LogError> {
        let mut found = None;
        let time = opened.time_of(t).into_iter().collect();
        self.moments(opened, &time, &mut |_, moment| {
            found.get_or_insert(moment);
        })?;
        Ok(found)
    }

    /// Passes the shapes of each step with its t; no calls without a log. Only one log at a time is read for shapes.
    pub fn each_shapes(&self, opened: &Opened, give: &mut dyn FnMut(usize, Vec<SceneShape>)) -> Result<(), LogError> {
        let _one = self.reading.lock().unwrap_or_else(PoisonError::into_inner);
        self.each_moment(opened, &mut |t, moment| give(t, moment.shapes))
    }

    /// Passes the log's record of each step with its t, reading the log once.
    pub fn each_moment(&self, opened: &Opened, give: &mut dyn FnMut(usize, Moment)) -> Result<(), LogError> {
        let times = opened.times();
        self.moments(opened, &times.keys().copied().collect(), &mut |time, moment| give(times[&time], moment))
    }

    /// Reads the log of an episode under way, or the first log that has steps of the episode.
    fn moments(
        &self,
        opened: &Opened,
        times: &BTreeSet<u64>,
        give: &mut dyn FnMut(u64, Moment),
    ) -> Result<(), LogError> {
        if let Some(log) = &opened.running {
            return frames::each_unfinished_moment(log, times, give);
        }
        for log in self.of(opened) {
            let index = self.index(log)?;
            let Some(index) = index.as_ref() else { continue };
            if index.each_moment(&opened.episode.episode_id, times, give)? {
                break;
            }
        }
        Ok(())
    }

    fn of(&self, opened: &Opened) -> impl Iterator<Item = &PathBuf> {
        let beside = opened.input.as_ref().map(|input| input.path.with_extension("mcap"));
        let own = self.paths.iter().find(|log| Some(*log) == beside.as_ref());
        let others = if own.is_none() { self.paths.as_slice() } else { &[] };
        own.into_iter().chain(others)
    }

    /// The index of a log, read once; `None` if it has no index or is not the log of a recording.
    fn index(&self, log: &Path) -> Result<Arc<Option<LogIndex>>, LogError> {
        self.indices.get(log.to_owned(), || match LogIndex::open(log) {
            Err(LogError::Foreign { .. }) => Ok(None),
            opened => opened,
        })
    }
}
