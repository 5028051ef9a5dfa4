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
mod tests {
    //! Reference values from scipy 1.17.1: every outcome weighted by `binom.pmf`; the tests are `2 * binom.cdf` at 1/2,
    //! `fisher_exact` and `binomtest`. Sizes are found by trying each, smallest differences by `brentq`.
    #![expect(clippy::unreadable_literal, reason = "reference values as their source prints them")]

    use super::exact_tests::probabilities;
    use super::{Anytime, BySeed, Clusters, Fisher, McNemar, OneRate, Power, Rates, Seeds, smallest};
    use crate::comparisons::paired::Pairs;
    use crate::comparisons::unpaired::fisher;
    use mirrorstats_exact::ratio::Ratio;

    const HOLM: f64 = 0.05 / 28.0;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "found {found}, expected {expected}");
    }

    fn pairs(level: f64, rates: Rates) -> McNemar {
        McNemar::new(level, rates.difference(), rates.independent_discordance())
    }

    fn rates(lower: f64, higher: f64) -> Rates {
        Rates { lower, higher }
    }

    #[test]
    fn paired_power_matches_known_values() {
        for (n, level, of, expected) in [
            (21, 0.05, rates(0.35, 0.65), 0.3573349060535207),
            (21, HOLM, rates(0.2, 0.9), 0.8660932225112565),
            (40, HOLM, rates(0.3, 0.7), 0.5798132303080298),
            (60, 0.01, rates(0.1, 0.3), 0.46885627425653903),
        ] {
            close(pairs(level, of).power(n), expected);
        }
        close(McNemar::new(0.05, 0.3, 0.4).power(30), 0.713146990445221);
        // All discordant pairs favour one model.
        close(McNemar::new(0.05, 0.3, 0.3).power(30), 0.9234052479924492);
    }

    #[test]
    fn unpaired_power_matches_known_values() {
        for (n, level, of, expected) in [
            (21, 0.05, rates(0.35, 0.65), 0.3569567112674831),
            (21, HOLM, rates(0.2, 0.9), 0.9607203914437078),
            (30, HOLM, rates(0.3, 0.7), 0.4516049706906783),
            (17, 0.01, rates(0.1, 0.6), 0.5882535136464697),
        ] {
            close(Fisher { level, rates: of }.power(n), expected);
        }
    }

    #[test]
    fn power_against_chance_matches_known_values() {
        let ratio = |above, below| Ratio::new(above, below).unwrap();
        for (n, level, chance, rate, expected) in [
            (21, 0.05, ratio(1, 3), 0.6, 0.6914440331282141),
            (21, 0.05 / 8.0, ratio(1, 3), 0.7, 0.7229932023760066),
            (50, 0.05, ratio(1, 10), 0.25, 0.8363166660715647),
        ] {
            close(OneRate { level, chance, rate }.power(n), expected);
        }
    }

    #[test]
    fn the_smallest_sizes_match_known_values() {
        let seeds = |seeds| Clusters { seeds, icc: 0.0, people: false };
        let around = |difference| Rates::apart(difference, None).unwrap();
        assert_eq!(seeds(3).runs_for(0.8, &mut pairs(0.05, around(0.3))), Some(17));
        assert_eq!(seeds(1).runs_for(0.8, &mut pairs(HOLM, around(0.5))), Some(36));
        assert_eq!(seeds(3).runs_for(0.8, &mut Fisher { level: 0.05, rates: around(0.5) }), Some(6));
        let chance = Ratio::new(1, 3).unwrap();
        assert_eq!(seeds(3).runs_for(0.8, &mut OneRate { level: 0.05, chance, rate: 1.0 / 3.0 + 0.3 }), Some(8));
        // A zero difference is never found with more than the level.
        assert_eq!(seeds(200).runs_for(0.8, &mut pairs(0.05, around(0.0))), None);
    }

    #[test]
    fn smallest_differences_match_known_values() {
        let around = |difference| Rates::apart(difference, None).unwrap();
        let paired = |level| smallest(0.8, 1.0, |difference| pairs(level, around(difference)).power(21)).unwrap();
        close(paired(0.05), 0.4744232099584026);
        close(paired(HOLM), 0.675283428012498);
        let unpaired = smallest(0.8, 1.0, |difference| Fisher { level: 0.05, rates: around(difference) }.power(21));
        close(unpaired.unwrap(), 0.4697993119695569);
        assert_eq!(smallest(0.8, 1.0, |difference| pairs(0.05, around(difference)).power(5)), None);
    }

    /// The p values of `stats` decide each outcome, weighted by its probability.
    #[test]
    fn power_agrees_with_the_tests_of_statistics() {
        let (level, difference, discordance) = (0.05, 0.4, 0.5);
        for n in [5_u64, 9, 14] {
            let outcomes = (0..=n).flat_map(|first| (0..=n - first).map(move |second| (first, second)));
            let rejected = outcomes.filter(|&(first_only, second_only)| {
                let pairs = Pairs { first_only, second_only, neither: n - first_only - second_only, both: 0 };
                pairs.mcnemar().unwrap() <= level
            });
            let multinomial = |(a, b): (u64, u64)| {
                let decided = probabilities(n, discordance)[usize::try_from(a + b).unwrap()];
                decided * probabilities(a + b, 0.9)[usize::try_from(a).unwrap()]
            };
            close(McNemar::new(level, difference, discordance).power(n), rejected.map(multinomial).sum());
            let (rates, mut sum) = (rates(0.2, 0.8), 0.0);
            let [lower, higher] = [rates.lower, rates.higher].map(|rate| probabilities(n, rate));
            for (a, p) in (0..).zip(&lower) {
                for (b, q) in (0..).zip(&higher) {
                    sum += if fisher((a, n), (b, n)).unwrap().p <= level { p * q } else { 0.0 };
                }
            }
            close(Fisher { level, rates }.power(n), sum);
        }
    }

    // Python, by enumeration: 12 pairs with discordant shares 0.45 and 0.05, e = beta(a + 1/2, b + 1/2) / (pi * 2^-(a +
    // b)), looks after 3, 6, 9 and 12 pairs, rejection if 1 / e <= 0.05.
    #[test]
    fn looks_stop_at_the_boundary_of_sequential_statistics() {
        let mut test = Anytime::pairs(0.05, 3, 0.4, 0.5).unwrap();
        close(test.power(12), 0.17797300576576222);
        close(test.expected(12), 11.874138764824218);
        close(test.boundary(), 20.0);
        let mut test = Anytime::rate(0.05, 3, Ratio::new(1, 3).unwrap(), 0.8);
        close(test.power(12), 0.6052045168640005);
        close(test.expected(12), 9.823156223999998);
        // A true hypothesis is ever rejected with a probability of at most the level, however many looks there are.
        assert!(Anytime::pairs(0.05, 1, 0.0, 0.5).unwrap().power(200) < 0.05);
    }

    // Python, by enumeration of all sums of six seeds with three runs, the copied outcome of a seed with probability sqrt(0.2).
    #[test]
    fn seeds_count_once_in_a_plan_too() {
        let chance = Ratio::new(1, 3).unwrap();
        let of = |test| Seeds { test, level: 0.05, seeds: 6, icc: 0.2 };
        close(of(BySeed::Rate { chance, rate: 0.8 }).power(3), 0.5159454035323163);
        let simulated = of(BySeed::Pairs { difference: 0.5, discordance: 0.6 }).power(3);
        assert!((simulated - 0.24331089963269045).abs() < 0.035, "{simulated}");
        // With one run per seed: the test of McNemar over the seeds.
        close(of(BySeed::Pairs { difference: 0.5, discordance: 0.6 }).power(1), McNemar::new(0.05, 0.5, 0.6).power(6));
        // With any number of runs, 3 seeds show nothing.
        let three = Clusters { seeds: 3, icc: 0.1, people: false };
        let test = BySeed::Pairs { difference: 0.9, discordance: 0.9 };
        close(three.power(&mut Seeds { test, level: 0.05, seeds: 3, icc: 0.1 }, 50), 0.0);
    }

    #[test]
    fn rates_stay_within_zero_and_one() {
        assert_eq!(Rates::apart(0.3, Some(0.8)), None);
        assert_eq!(Rates::apart(1.2, None), None);
        assert_eq!(Rates::apart(0.5, Some(0.5)), Some(rates(0.5, 1.0)));
        let (least, most) = rates(0.35, 0.65).possible_discordance();
        close(least, 0.3);
        close(most, 1.0);
    }

    /// The search skips no smaller size that has the power.
    #[test]
    fn no_smaller_size_has_the_power() {
        for difference in [0.2, 0.25, 0.35, 0.45, 0.6] {
            let rates = Rates::apart(difference, None).unwrap();
            let clusters = Clusters { seeds: 1, icc: 0.0, people: false };
            let found = clusters.runs_for(0.8, &mut pairs(0.05, rates)).unwrap();
            let mut test = pairs(0.05, rates);
            assert_eq!((1..=found).find(|n| test.power(*n) >= 0.8), Some(found), "{difference}");
        }
    }
}
