//! The remaining episodes of a recording, and the outcomes of the others.
//!
//! Rule: an experiment is complete, and returned once, when all of its episodes are recorded, lost or left out.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, PoisonError};

use super::failures::LostEpisode;
use super::plan::Key;
use super::replies::GivenUp;
use mirrorstats_agents::{Turn, locked};
use mirrorstats_experiment::Experiment;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    pub recorded: Vec<Key>,
    pub steps: u64,
    pub lost: Vec<(Key, LostEpisode)>,
    pub under_way: Vec<Key>,
    /// True if a spending limit stopped it.
    pub by_limit: bool,
    /// The number of episodes not played because their participants have left.
    pub left_out: usize,
    pub stopped: bool,
    /// The reason for the stop, if the agent could not answer.
    pub given_up: Option<GivenUp>,
}

#[derive(Debug)]
pub(crate) struct Queue(Mutex<WaitingKeys>);

#[derive(Debug)]
struct WaitingKeys {
    keys: VecDeque<Key>,
    /// The episodes of each experiment that have no outcome yet.
    left: BTreeMap<Experiment, usize>,
    complete: Vec<Experiment>,
    tally: Tally,
}

impl WaitingKeys {
    fn count(&mut self, experiment: &Experiment) {
        let left = self.left.entry(experiment.clone()).or_default();
        *left = left.saturating_sub(1);
        if *left == 0 {
            self.complete.push(experiment.clone());
        }
    }
}

#[derive(Debug)]
pub(crate) enum Next {
    Play(Key),
    /// Ask again later: the players of the remaining episodes are busy.
    Later,
    Nothing,
}

impl Queue {
    pub(crate) fn new(keys: &[Key]) -> Self {
        let mut left = BTreeMap::new();
        for key in keys {
            *left.entry(key.experiment.clone()).or_default() += 1;
        }
        let keys = keys.iter().cloned().collect();
        Self(Mutex::new(WaitingKeys { keys, left, complete: Vec::new(), tally: Tally::default() }))
    }

    pub(super) fn experiments(&self) -> Vec<Experiment> {
        locked(&self.0).left.keys().cloned().collect()
    }

    pub(crate) fn next(&self, turn: impl Fn(&Key) -> Turn) -> Next {
        let mut waiting = locked(&self.0);
        let mut at = 0;
        while let Some(key) = waiting.keys.get(at).cloned() {
            match turn(&key) {
                Turn::Now => {
                    waiting.keys.remove(at);
                    return Next::Play(key);
                }
                Turn::Later => at += 1,
                Turn::Never => {
                    waiting.keys.remove(at);
                    waiting.tally.left_out += 1;
                    waiting.count(&key.experiment);
                }
            }
        }
        if at > 0 { Next::Later } else { Next::Nothing }
    }

    /// Returns an episode whose player has left to the queue.
    pub(crate) fn again(&self, key: Key) {
        locked(&self.0).keys.push_back(key);
    }

    pub(crate) fn recorded(&self, key: Key, steps: usize) {
        let mut waiting = locked(&self.0);
        waiting.count(&key.experiment);
        waiting.tally.recorded.push(key);
        waiting.tally.steps += steps as u64;
    }

    pub(crate) fn lost(&self, key: Key, lost: LostEpisode) {
        let mut waiting = locked(&self.0);
        waiting.count(&key.experiment);
        waiting.tally.lost.push((key, lost));
    }

    /// Notes an episode that was stopped before its end, perhaps by a spending limit.
    pub(crate) fn stopped(&self, key: Key, by_limit: bool) {
        let tally = &mut locked(&self.0).tally;
        tally.under_way.push(key);
        tally.stopped = true;
        tally.by_limit |= by_limit;
    }

    /// The newly complete experiments, each with its recorded and its lost episodes.
    pub(crate) fn complete(&self) -> Vec<(Experiment, Vec<Key>, Vec<LostEpisode>)> {
        let mut waiting = locked(&self.0);
        let complete = std::mem::take(&mut waiting.complete);
        let outcomes = |experiment: Experiment| {
            let is_own = |key: &Key| key.experiment == experiment;
            let recorded = waiting.tally.recorded.iter().filter(|key| is_own(key)).cloned().collect();
            let lost = waiting.tally.lost.iter().filter(|(key, _)| is_own(key));
            let lost = lost.map(|(_, lost)| lost.clone()).collect();
            (experiment, recorded, lost)
        };
        complete.into_iter().map(outcomes).collect()
    }

    /// The outcomes in order, once no thread uses the queue.
    pub(super) fn into_tally(self) -> Tally {
        let WaitingKeys { keys, mut tally, .. } = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        tally.recorded.sort_unstable();
        tally.lost.sort_by(|(key, _), (other, _)| key.cmp(other));
        tally.under_way.sort_unstable();
        tally.stopped |= !keys.is_empty();
        tally
    }
}
