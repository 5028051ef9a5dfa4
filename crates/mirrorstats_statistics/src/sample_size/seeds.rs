//! Seeds with similar episodes: the tests of `units`, which count each seed once.

use super::{McNemar, Power};
use crate::comparisons::units::{Sides, difference_test, rate_test_of_sum};
use crate::intervals::random::SplitMix64;
use crate::outcomes::{convolved, size};
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::ratio::Ratio;

/// The number of simulated studies for a power over pairs; its standard error is at most 0.012.
pub const STUDIES: u32 = 2_000;
/// The initial state of their random numbers.
pub const SEED: u64 = 20_260_203;

/// The tested quantity of each seed.
#[derive(Clone, Copy, Debug)]
pub enum BySeed {
    /// The difference of two models that share their seeds, and the share of discordant pairs.
    Pairs {
        difference: f64,
        discordance: f64,
    },
    Rate {
        chance: Ratio,
        rate: f64,
    },
}

/// A test over seeds with equal numbers of runs. An episode takes its seed's outcome with probability sqrt(intraclass
/// correlation), otherwise its own.
#[derive(Clone, Copy, Debug)]
pub struct Seeds {
    pub test: BySeed,
    pub level: f64,
    pub seeds: u64,
    pub icc: f64,
}

impl Power for Seeds {
    fn power(&mut self, n: u64) -> f64 {
        match self.test {
            BySeed::Pairs { difference, discordance } if n == 1 => {
                McNemar::new(self.level, difference, discordance).power(self.seeds)
            }
            BySeed::Pairs { difference, discordance } => {
                let [better, worse] = [difference, -difference].map(|sign| f64::midpoint(discordance, sign));
                self.of_pairs(&self.sums([worse.max(0.0), 1.0 - discordance, better], n), n)
            }
            BySeed::Rate { chance, rate } => self.of_rate(&self.sums([0.0, 1.0 - rate, rate], n), n, chance),
        }
    }
}

impl Seeds {
    /// The probability of each sum of a seed's `runs` outcomes, from `-runs` to `runs`; an outcome is -1, 0 or 1.
    fn sums(&self, shares: [f64; 3], runs: u64) -> Vec<f64> {
        let copied = self.icc.sqrt();
        let mut all = vec![0.0; 2 * size(runs) + 1];
        for drawn in 0..3 {
            let each = [0, 1, 2].map(|at| (1.0 - copied) * shares[at] + if at == drawn { copied } else { 0.0 });
            let sums = (0..runs).fold(vec![1.0], |sums, _| convolved(&sums, &each));
            all.iter_mut().zip(sums).for_each(|(sum, part)| *sum += shares[drawn] * part);
        }
        all
    }

    fn of_rate(&self, sums: &[f64], runs: u64, chance: Ratio) -> f64 {
        let successes = &sums[size(runs)..];
        let all = (0..self.seeds).fold(vec![1.0], |all, _| convolved(&all, successes));
        let rejects =
            |sum: i128| rate_test_of_sum(sum, runs.into(), self.seeds, chance).is_some_and(|test| test.p <= self.level);
        let rejected = (0..).zip(all).filter(|(sum, _)| rejects(*sum));
        rejected.map(|(_, probability)| probability).sum::<f64>().min(1.0)
    }

    fn of_pairs(&self, sums: &[f64], runs: u64) -> f64 {
        let mut random = SplitMix64::seeded(SEED);
        let mut study = || {
            let shared = (0..self.seeds).map(|_| pair(drawn(sums, random.unit()), runs)).collect();
            difference_test(&Sides { shared, ..Sides::default() }).is_some_and(|test| test.p <= self.level)
        };
        let rejected = (0..STUDIES).filter(|_| study()).count();
        f64::from(u32::try_from(rejected).unwrap_or(STUDIES)) / f64::from(STUDIES)
    }
}

fn drawn(probabilities: &[f64], at: f64) -> usize {
    let mut below = 0.0;
    let is_reached = |probability: &f64| {
        below += probability;
        at < below
    };
    probabilities.iter().position(is_reached).unwrap_or(probabilities.len() - 1)
}

/// The episodes of both models in a seed with sums that differ by `at` minus the runs.
fn pair(at: usize, runs: u64) -> (Moments, Moments) {
    let runs = size(runs);
    let of = |successes: usize| Moments::default().with_truths(runs - successes, successes).unwrap_or_default();
    (of(at.saturating_sub(runs)), of(runs.saturating_sub(at)))
}
