//! One model against a fixed level, such as chance: the exact binomial test.

use super::Power;
use super::binomial::{likely, probabilities};
use crate::chance;
use exact::ratio::Ratio;

/// The exact two-sided test of one rate against a level of chance.
#[derive(Clone, Copy, Debug)]
pub struct OneRate {
    /// The level that p must not exceed.
    pub level: f64,
    /// The rate under the null hypothesis.
    pub chance: Ratio,
    /// The true rate.
    pub rate: f64,
}

impl Power for OneRate {
    fn power(&mut self, n: u64) -> f64 {
        let probabilities = probabilities(n, self.rate);
        let rejects = |successes: &u64| chance::two_sided(*successes, n, self.chance).is_some_and(|p| p <= self.level);
        let counts = likely(&probabilities).filter(rejects);
        counts.map(|successes| probabilities[usize::try_from(successes).expect("a count of episodes")]).sum()
    }
}
