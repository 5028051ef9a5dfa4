//! The endings of episodes, and the walk over their risk sets that every curve is built from.

use std::collections::BTreeMap;

/// One episode: the number of steps until it ended, and its outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ending {
    /// The steps until the decision, or until the recording stopped.
    pub steps: i64,
    pub outcome: Outcome,
}

/// The outcome of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// A correct decision, the awaited event.
    Correct,
    /// A wrong decision, after which a correct one can no longer come.
    Wrong,
    /// No decision: censored.
    Unfinished,
}

/// The episodes at one step in which some ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RiskSet {
    pub steps: i64,
    /// The episodes that lasted until this step.
    pub at_risk: u64,
    /// The episodes that ended in this step, by [`Outcome`].
    pub ended: [u64; 3],
    /// The share undecided before this step.
    pub before: f64,
    /// The share undecided after this step.
    pub after: f64,
}

/// The steps in which an episode ended, ascending. A decision in a step comes before censoring in that step.
pub(crate) fn risk_sets(endings: &[Ending]) -> Vec<RiskSet> {
    let mut ends: BTreeMap<i64, [u64; 3]> = BTreeMap::new();
    for ending in endings {
        ends.entry(ending.steps).or_default()[ending.outcome as usize] += 1;
    }
    let (mut at_risk, mut before) = (endings.len() as u64, 1.0);
    let of_step = |(steps, ended): (i64, [u64; 3])| {
        let undecided = at_risk - ended[Outcome::Correct as usize] - ended[Outcome::Wrong as usize];
        let after = before * (undecided as f64 / at_risk as f64);
        let set = RiskSet { steps, at_risk, ended, before, after };
        at_risk -= ended.iter().sum::<u64>();
        before = after;
        set
    };
    ends.into_iter().map(of_step).collect()
}
