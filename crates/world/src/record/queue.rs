//! The episodes that a recording has still to take.
//!
//! Rule: an episode is taken with its lock, so that processes that record the same episodes divide them. One that another
//! process has is asked for again until it is recorded, or that process has given it back or has ended. An experiment is
//! complete, and given once, when all of its episodes are recorded, by whomever, or lost.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::error::StoreError;
use super::failures::LostEpisode;
use super::lock::EpisodeLock;
use super::plan::Key;
use super::store::{Store, Turn};
use crate::sim::Experiment;

/// The episodes of a recording that no thread has taken yet.
#[derive(Debug)]
pub struct Queue<'a> {
    store: &'a Store,
    waiting: Mutex<Waiting>,
}

#[derive(Debug)]
struct Waiting {
    keys: VecDeque<Key>,
    /// Those that other processes have recorded since.
    elsewhere: Vec<Key>,
    experiments: BTreeMap<Experiment, Outcomes>,
    complete: Vec<Complete>,
}

/// The outcomes of an experiment's episodes so far.
#[derive(Debug, Default)]
struct Outcomes {
    left: usize,
    recorded: Vec<Key>,
    lost: Vec<(Key, LostEpisode)>,
}

/// An experiment of which no episode is left.
#[derive(Debug)]
pub struct Complete {
    pub experiment: Experiment,
    /// Its episodes that are recorded now.
    pub recorded: Vec<Key>,
    /// Its episodes that were lost.
    pub lost: Vec<(Key, LostEpisode)>,
}

impl Waiting {
    fn end(&mut self, key: Key, lost: Option<LostEpisode>) {
        let outcomes = self.experiments.entry(key.experiment).or_default();
        match lost {
            Some(lost) => outcomes.lost.push((key, lost)),
            None => outcomes.recorded.push(key),
        }
        outcomes.left = outcomes.left.saturating_sub(1);
        if outcomes.left == 0 {
            let Outcomes { recorded, lost, .. } = std::mem::take(outcomes);
            self.complete.push(Complete { experiment: key.experiment, recorded, lost });
        }
    }
}

/// The next work of a thread.
#[derive(Debug)]
pub enum Next {
    Play(Key, EpisodeLock),
    /// Ask again later: other processes have all that are left.
    Held(Held),
    /// Nothing: all are taken.
    Nothing,
}

/// Episodes that other processes have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    /// One of them.
    pub key: Key,
    /// The id of the process that has it, as far as it is known.
    pub process: Option<u32>,
    pub count: usize,
}

impl<'a> Queue<'a> {
    /// These episodes, in this order.
    pub fn new(store: &'a Store, keys: &[Key]) -> Self {
        let mut experiments = BTreeMap::<Experiment, Outcomes>::new();
        for key in keys {
            experiments.entry(key.experiment).or_default().left += 1;
        }
        let (elsewhere, complete) = (Vec::new(), Vec::new());
        let waiting = Waiting { keys: keys.iter().copied().collect(), elsewhere, experiments, complete };
        Self { store, waiting: Mutex::new(waiting) }
    }

    pub(super) fn experiments(&self) -> Vec<Experiment> {
        self.waiting().experiments.keys().copied().collect()
    }

    /// The next episode, with its lock.
    pub fn next(&self) -> Result<Next, StoreError> {
        let mut waiting = self.waiting();
        let mut held = None;
        for _ in 0..waiting.keys.len() {
            let Some(key) = waiting.keys.pop_front() else { break };
            match self.store.turn(key)? {
                Turn::Ours(lock) => return Ok(Next::Play(key, lock)),
                Turn::Recorded => {
                    waiting.elsewhere.push(key);
                    waiting.end(key, None);
                }
                Turn::Theirs(process) => {
                    waiting.keys.push_back(key);
                    held = held.or(Some((key, process)));
                }
            }
        }
        let count = waiting.keys.len();
        Ok(held.map_or(Next::Nothing, |(key, process)| Next::Held(Held { key, process, count })))
    }

    /// Notes that an episode which was taken is recorded, or lost.
    pub fn ended(&self, key: Key, lost: Option<LostEpisode>) {
        self.waiting().end(key, lost);
    }

    /// The experiments that have become complete since this was last asked.
    pub fn complete(&self) -> Vec<Complete> {
        std::mem::take(&mut self.waiting().complete)
    }

    pub fn has_more(&self) -> bool {
        !self.waiting().keys.is_empty()
    }

    /// The episodes that other processes have recorded meanwhile.
    pub fn elsewhere(&self) -> Vec<Key> {
        self.waiting().elsewhere.clone()
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
