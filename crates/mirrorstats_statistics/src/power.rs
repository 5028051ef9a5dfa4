//! The smallest difference that a comparison of this size can detect.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::comparisons::unpaired::fisher;
use super::feasible::first_not;
use super::intervals::quantile;

/// The power with which a difference counts as one that would have been shown.
pub const POWER: f64 = 0.8;

/// The smallest difference of two rates that an exact test of n pairs, or of n episodes on each side, could have shown.
///
/// In the most favourable case: all discordant pairs point the same way, or one side has no success. Else more is needed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Detectable {
    /// The number of pairs, or of episodes on each side.
    pub n: u64,
    /// The level that p must not exceed.
    pub level: f64,
    /// The fewest pairs, all in one direction, or the fewest successes against none, with p at most the level.
    pub pairs: u64,
    /// The same as a difference of rates: the smallest one that could have been significant.
    pub smallest: f64,
    /// The true difference that would have been found with a probability of 0.8; none for independent samples, where it
    /// depends on both rates.
    pub likely: Option<f64>,
}

/// The smallest detectable difference of `n` pairs at `level`; `None` if no outcome reaches it. A family of m tests
/// under Holm's procedure needs `level / m` for its first rejection. d pairs in one direction have p = 2^(1-d); the
/// power is a binomial tail, inverted by the beta distribution.
pub fn detectable(n: u64, level: f64) -> Option<Detectable> {
    let p_values = std::iter::successors(Some(1.0), |p| Some(p / 2.0));
    let (pairs, _) = (1..=n).zip(p_values).find(|(_, p)| *p <= level)?;
    Some(Detectable {
        n,
        level,
        pairs,
        smallest: pairs as f64 / n as f64,
        likely: Some(1.0 - quantile::beta(quantile::settled(1.0 - POWER), (n - pairs + 1) as f64, pairs as f64)),
    })
}

/// The same for two independent samples of `n` episodes each by Fisher's exact test: k successes against zero.
pub fn detectable_unpaired(n: u64, level: f64) -> Option<Detectable> {
    let is_enough = |k: u64| fisher((k, n), (0, n)).is_some_and(|test| test.p <= level);
    // The p value falls with k.
    let enough = first_not((1, n.into()), |k| !u64::try_from(k).is_ok_and(is_enough));
    let enough = u64::try_from(enough).ok().filter(|enough| *enough <= n)?;
    Some(Detectable { n, level, pairs: enough, smallest: enough as f64 / n as f64, likely: None })
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{detectable, detectable_unpaired};

    // scipy 1.17.1: beta.ppf(0.8, k, n - k + 1); 2 * 0.5**6 = 0.03125 is the first p at most 0.05
    #[test]
    fn twenty_one_pairs_show_six_at_best() {
        let one = detectable(21, 0.05).unwrap();
        assert_eq!((one.pairs, one.smallest), (6, 6.0 / 21.0));
        assert!((one.likely.unwrap() - 0.35032843001535).abs() < 1e-10, "{one:?}");
        let family = detectable(21, 0.05 / 28.0).unwrap();
        assert_eq!(family.pairs, 11);
        assert!((family.likely.unwrap() - 0.589997196567057).abs() < 1e-10, "{family:?}");
    }

    // scipy 1.17.1: fisher_exact([[k, 21 - k], [0, 21]]).pvalue is 0.0478 for k = 5, 0.1069 for 4 and 0.0013 for 9
    #[test]
    fn twenty_one_episodes_each_show_five_against_none() {
        assert_eq!(detectable_unpaired(21, 0.05).unwrap().pairs, 5);
        assert_eq!(detectable_unpaired(21, 0.05 / 28.0).unwrap().pairs, 9);
        assert_eq!(detectable_unpaired(3, 0.05), None);
        assert_eq!(detectable_unpaired(4, 0.05).unwrap().pairs, 4);
        assert_eq!(detectable_unpaired(0, 0.05), None);
    }

    #[test]
    fn five_pairs_can_show_nothing() {
        assert_eq!(detectable(5, 0.05), None);
        assert_eq!(detectable(6, 0.05).unwrap().pairs, 6);
        assert_eq!(detectable(0, 0.05), None);
        assert_eq!(detectable(21, 0.0), None);
    }
}
