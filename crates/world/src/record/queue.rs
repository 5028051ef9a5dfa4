//! The remaining episodes of a recording.
//!
//! Rule: taking an episode locks it, so that processes recording the same episodes divide them. An episode held by
//! another process is tried again until it is recorded or released, or that process has ended. An experiment is
//! complete, and returned once, when all of its episodes are recorded, by any process, or lost.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, PoisonError};

use super::error::StoreError;
use super::failures::LostEpisode;
use super::lock::EpisodeLock;
use super::plan::Key;
use super::store::{Claim, Store};
use crate::agent::{Turn, locked};
use crate::sim::Experiment;

/// The episodes of a recording that no thread has taken yet.
#[derive(Debug)]
pub(crate) struct Queue<'a> {
    store: &'a Store,
    waiting: Mutex<WaitingKeys>,
}

#[derive(Debug)]
struct WaitingKeys {
    keys: VecDeque<Key>,
    /// Episodes that other processes have recorded since.
    elsewhere: Vec<Key>,
    /// The number of episodes without a player.
    left_out: usize,
    experiments: BTreeMap<Experiment, Outcomes>,
    complete: Vec<(Experiment, Outcomes)>,
}

#[derive(Debug, Default)]
pub struct Outcomes {
    left: usize,
    pub recorded: Vec<Key>,
    pub lost: Vec<(Key, LostEpisode)>,
}

impl WaitingKeys {
    fn end(&mut self, key: &Key, lost: Option<LostEpisode>) {
        let outcomes = self.experiments.entry(key.experiment.clone()).or_default();
        match lost {
            Some(lost) => outcomes.lost.push((key.clone(), lost)),
            None => outcomes.recorded.push(key.clone()),
        }
        self.count(&key.experiment);
    }

    fn count(&mut self, experiment: &Experiment) {
        let outcomes = self.experiments.entry(experiment.clone()).or_default();
        outcomes.left = outcomes.left.saturating_sub(1);
        if outcomes.left == 0 {
            self.complete.push((experiment.clone(), std::mem::take(outcomes)));
        }
    }
}

#[derive(Debug)]
pub enum Next {
    Play(Key, EpisodeLock),
    /// Ask again later: other processes have all remaining episodes.
    Held(Held),
    /// Ask again later: the players of the remaining episodes are busy.
    Later,
    /// None: all are taken.
    Nothing,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Held {
    /// One of them.
    pub key: Key,
    /// The id of the process that has it, if known.
    pub process: Option<u32>,
    pub count: usize,
}

impl<'a> Queue<'a> {
    pub fn new(store: &'a Store, keys: &[Key]) -> Self {
        let mut experiments = BTreeMap::<Experiment, Outcomes>::new();
        for key in keys {
            experiments.entry(key.experiment.clone()).or_default().left += 1;
        }
        let (elsewhere, complete) = (Vec::new(), Vec::new());
        let keys = keys.iter().cloned().collect();
        let waiting = WaitingKeys { keys, elsewhere, left_out: 0, experiments, complete };
        Self { store, waiting: Mutex::new(waiting) }
    }

    pub(super) fn experiments(&self) -> Vec<Experiment> {
        locked(&self.waiting).experiments.keys().cloned().collect()
    }

    pub fn next(&self, turn: impl Fn(&Key) -> Turn) -> Result<Next, StoreError> {
        let mut waiting = locked(&self.waiting);
        let (mut held, mut at, mut is_later) = (None, 0, false);
        for _ in 0..waiting.keys.len() {
            let Some(key) = waiting.keys.get(at).cloned() else { break };
            match turn(&key) {
                Turn::Now => waiting.keys.remove(at),
                Turn::Later => {
                    (at, is_later) = (at + 1, true);
                    continue;
                }
                Turn::Never => {
                    waiting.keys.remove(at);
                    waiting.left_out += 1;
                    waiting.count(&key.experiment);
                    continue;
                }
            };
            match self.store.turn(&key)? {
                Claim::Ours(lock) => return Ok(Next::Play(key, lock)),
                Claim::Recorded => {
                    waiting.end(&key, None);
                    waiting.elsewhere.push(key);
                }
                Claim::Theirs(process) => {
                    held = held.or_else(|| Some((key.clone(), process)));
                    waiting.keys.push_back(key);
                }
            }
        }
        let count = waiting.keys.len();
        let nothing = if is_later { Next::Later } else { Next::Nothing };
        Ok(held.map_or(nothing, |(key, process)| Next::Held(Held { key, process, count })))
    }

    /// Returns an episode whose player has left to the queue.
    pub fn again(&self, key: Key) {
        locked(&self.waiting).keys.push_back(key);
    }

    pub fn ended(&self, key: &Key, lost: Option<LostEpisode>) {
        locked(&self.waiting).end(key, lost);
    }

    /// The experiments completed since the last call.
    pub fn complete(&self) -> Vec<(Experiment, Outcomes)> {
        std::mem::take(&mut locked(&self.waiting).complete)
    }

    /// Once no thread uses the queue: the episodes that other processes have recorded in the meantime, the number
    /// without a player, and true if episodes remain.
    pub(super) fn into_rest(self) -> (Vec<Key>, usize, bool) {
        let rest = self.waiting.into_inner().unwrap_or_else(PoisonError::into_inner);
        (rest.elsewhere, rest.left_out, !rest.keys.is_empty())
    }
}
