//! The remaining episodes of a recording.
//!
//! Rule: an experiment is complete, and returned once, when all of its episodes are recorded, lost or left out.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, PoisonError};

use super::failures::LostEpisode;
use super::plan::Key;
use mirrorstats_agents::{Turn, locked};
use mirrorstats_experiment::Experiment;

#[derive(Debug)]
pub(crate) struct Queue(Mutex<WaitingKeys>);

#[derive(Debug)]
struct WaitingKeys {
    keys: VecDeque<Key>,
    /// The number of episodes without a player.
    left_out: usize,
    experiments: BTreeMap<Experiment, Outcomes>,
    complete: Vec<(Experiment, Outcomes)>,
}

#[derive(Debug, Default)]
pub(crate) struct Outcomes {
    left: usize,
    pub(crate) recorded: Vec<Key>,
    pub(crate) lost: Vec<LostEpisode>,
}

impl WaitingKeys {
    fn count(&mut self, experiment: &Experiment) {
        let outcomes = self.experiments.entry(experiment.clone()).or_default();
        outcomes.left = outcomes.left.saturating_sub(1);
        if outcomes.left == 0 {
            self.complete.push((experiment.clone(), std::mem::take(outcomes)));
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
        let mut experiments = BTreeMap::<Experiment, Outcomes>::new();
        for key in keys {
            experiments.entry(key.experiment.clone()).or_default().left += 1;
        }
        let keys = keys.iter().cloned().collect();
        Self(Mutex::new(WaitingKeys { keys, left_out: 0, experiments, complete: Vec::new() }))
    }

    pub(super) fn experiments(&self) -> Vec<Experiment> {
        locked(&self.0).experiments.keys().cloned().collect()
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
                    waiting.left_out += 1;
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

    pub(crate) fn ended(&self, key: &Key, lost: Option<LostEpisode>) {
        let mut waiting = locked(&self.0);
        let outcomes = waiting.experiments.entry(key.experiment.clone()).or_default();
        match lost {
            Some(lost) => outcomes.lost.push(lost),
            None => outcomes.recorded.push(key.clone()),
        }
        waiting.count(&key.experiment);
    }

    pub(crate) fn complete(&self) -> Vec<(Experiment, Outcomes)> {
        std::mem::take(&mut locked(&self.0).complete)
    }

    /// Once no thread uses the queue: the number of episodes without a player, and true if episodes remain.
    pub(super) fn into_rest(self) -> (usize, bool) {
        let rest = self.0.into_inner().unwrap_or_else(PoisonError::into_inner);
        (rest.left_out, !rest.keys.is_empty())
    }
}
