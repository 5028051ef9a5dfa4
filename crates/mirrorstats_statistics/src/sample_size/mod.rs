//! Sample sizes of comparisons, and their exact power by enumeration.
//!
//! Rule: the tests are a report's, at a fixed level. Power is a sum over all outcomes, or a seeded simulation for pairs
//! by seed. The power of an exact test rises in a sawtooth, so sizes are tried one by one from below.

mod anytime;
mod exact_tests;
mod seeds;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use self::anytime::{Anytime, MOST_AT_LOOKS};
pub use self::exact_tests::{Fisher, McNemar, OneRate};
pub use self::seeds::{BySeed, SEED, STUDIES, Seeds};
pub use super::intervals::quantile::settled;
use crate::outcomes::TIE;

/// The most episodes per arm in a search.
pub const MOST_EPISODES: u64 = 2_000;

/// A test with known power for each number of episodes.
pub trait Power {
    /// The probability that the test rejects with `n` episodes per model.
    fn power(&mut self, n: u64) -> f64;

    fn most(&self) -> u64 {
        MOST_EPISODES
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    pub lower: f64,
    pub higher: f64,
}

impl Rates {
    /// Rates that are `difference` apart: from `baseline` up, or by default around 1/2, where a difference is hardest
    /// to show. `None` if they are outside [0, 1].
    pub fn apart(difference: f64, baseline: Option<f64>) -> Option<Self> {
        let lower = baseline.unwrap_or((1.0 - difference) / 2.0);
        let rates = Self { lower, higher: lower + difference };
        (difference >= 0.0 && lower >= 0.0 && rates.higher <= 1.0 + TIE).then_some(rates)
    }

    pub fn difference(self) -> f64 {
        self.higher - self.lower
    }

    /// The share of pairs in which exactly one episode succeeds, if successes are independent within a pair.
    pub fn independent_discordance(self) -> f64 {
        self.lower * (1.0 - self.higher) + self.higher * (1.0 - self.lower)
    }

    /// The possible shares of discordant pairs with these rates: from the difference up.
    pub fn possible_discordance(self) -> (f64, f64) {
        let sum = self.lower + self.higher;
        (self.difference(), sum.min(2.0 - sum))
    }
}

/// The resemblance of episodes with one seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Clusters {
    /// The number of seeds, each a cluster of as many episodes.
    pub seeds: u64,
    /// The intraclass correlation: 0 for independent episodes.
    pub icc: f64,
    /// True if the clusters are participants, each with as many scenes; tests always count them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub people: bool,
}

impl Clusters {
    /// Returns true if tests count clusters: participants, or seeds whose episodes resemble each other.
    pub fn are_units(self) -> bool {
        self.people || self.icc > 0.0
    }

    /// The number of units in a test: seeds or episodes.
    pub fn units(self, runs: u64) -> u64 {
        if self.are_units() { self.seeds } else { self.seeds * runs }
    }

    pub fn power(self, test: &mut dyn Power, runs: u64) -> f64 {
        test.power(if self.are_units() { runs } else { self.seeds * runs })
    }

    /// The fewest runs per seed with power of at least `wanted`; `None` if no number of episodes up to [`Power::most`]
    /// suffices. Doubling and bisection find a candidate; then runs are tried one by one from 20, or a fifth, below it.
    pub fn runs_for(self, wanted: f64, test: &mut dyn Power) -> Option<u64> {
        const NEAR: u64 = 20;
        let most = test.most() / self.seeds.max(1);
        let mut has_power = |runs: u64| self.power(test, runs) >= wanted;
        let doubled = std::iter::successors(Some(1), |runs| (*runs < most).then(|| (2 * runs).min(most)));
        let mut enough = doubled.into_iter().find(|runs| has_power(*runs))?;
        let mut too_few = enough / 2;
        while enough - too_few > 1 {
            let middle = u64::midpoint(too_few, enough);
            if has_power(middle) { enough = middle } else { too_few = middle }
        }
        let from = enough.saturating_sub(NEAR.max(enough / 5)).max(1);
        (from..=enough).find(|runs| has_power(*runs))
    }
}

/// The smallest argument in [0, `most`] with `power` of at least `wanted`, by bisection; `None` if even `most` has
/// less. `power` must rise with its argument. Forty halvings leave an error below 10^-12.
pub fn smallest(wanted: f64, most: f64, mut power: impl FnMut(f64) -> f64) -> Option<f64> {
    if power(most) < wanted {
        return None;
    }
    let (mut low, mut high) = (0.0, most);
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        if power(middle) >= wanted { high = middle } else { low = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests;
