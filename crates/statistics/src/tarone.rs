//! Many exact tests at once: tests that could not have reached significance take no share of the level.
//!
//! Rule: the least p value of each test must be fixed before the outcomes are known, or given what all tests of the
//! family condition on together. Then the error of the family is at most the level, whatever the dependence:
//! by design for binomial tests of fixed numbers of trials, by conditioning for the tests of `McNemar` and Fisher over
//! disjoint episodes. For comparisons that share a model (A with B, A with C) the discordant pairs of one test tell of
//! the outcomes of another, and no proof holds; `benches/COVERAGE.md` shows the error that simulation finds.
//! Only exact p values belong here: a mid-p value may lie below the least p value.

/// How much larger a least p value may be and still count as reached: the same number may come by another way.
const TIE: f64 = 1e-12;

/// One exact test: its p value, and the least that it could have had.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attained {
    /// The exact p value.
    pub p: f64,
    /// The least attainable p value, at most `p`: [`super::chance::least_p`],
    /// [`super::paired::Pairs::mcnemar_least_p`], [`super::unpaired::fisher_least_p`].
    pub least: f64,
}

/// Adjusted p values, in the order of the input: those at most the level are rejected.
///
/// Bonferroni's correction for the tests that can reach the p value at all (Tarone 1990, Biometrics 46:515), stepping
/// down as Holm does, and without the dependence on the level by which Tarone's own rule may reject at 0.04
/// and not at 0.05 (Hommel and Krummenauer 1998, Biometrics 54:673). In ascending order the i-th p value is multiplied by
/// the number of tests from the i-th on whose least p value is not above it. No adjusted value exceeds
/// that of [`super::holm::holm`].
#[expect(clippy::cast_precision_loss, reason = "a family has few tests")]
pub fn tarone_holm(tests: &[Attained]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..tests.len()).collect();
    order.sort_by(|&a, &b| tests[a].p.total_cmp(&tests[b].p));
    let mut adjusted = vec![0.0; tests.len()];
    let mut reached = 0.0f64;
    for (rank, &index) in order.iter().enumerate() {
        let p = tests[index].p;
        // A test of the same p value that cannot be below it counts, whatever rounding did to its least one.
        let can_reach = |&&other: &&usize| tests[other].least.min(tests[other].p) <= p * (1.0 + TIE);
        let count = order[rank..].iter().filter(can_reach).count();
        reached = reached.max((count as f64 * p).min(1.0));
        adjusted[index] = reached;
    }
    adjusted
}

/// Which tests are rejected at `level`, in the order of the input.
pub fn rejected(tests: &[Attained], level: f64) -> Vec<bool> {
    tarone_holm(tests).into_iter().map(|adjusted| adjusted <= level).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{Attained, rejected, tarone_holm};
    use crate::chance;
    use crate::holm::holm;
    use exact::ratio::Ratio;

    fn family(tests: &[(f64, f64)]) -> Vec<Attained> {
        tests.iter().map(|&(p, least)| Attained { p, least }).collect()
    }

    /// Tarone's own rule, written out: the smallest k with at most k tests that can reach level / k; then again
    /// over the tests that are left.
    fn by_tarones_rule(tests: &[Attained], level: f64) -> Vec<bool> {
        let mut is_rejected = vec![false; tests.len()];
        loop {
            let left: Vec<usize> = (0..tests.len()).filter(|&index| !is_rejected[index]).collect();
            let can_reach = |bound: f64| left.iter().filter(|&&index| tests[index].least <= bound).count();
            #[expect(clippy::cast_precision_loss, reason = "a family has few tests")]
            let Some(k) = (1..=left.len()).find(|&k| can_reach(level / k as f64) <= k) else { return is_rejected };
            #[expect(clippy::cast_precision_loss, reason = "a family has few tests")]
            let found: Vec<usize> = left.into_iter().filter(|&index| tests[index].p <= level / k as f64).collect();
            if found.is_empty() {
                return is_rejected;
            }
            for index in found {
                is_rejected[index] = true;
            }
        }
    }

    // By hand: 0.01 is reached by the first and the second; then 0.03 by the second alone; 0.5 by both that are left.
    #[test]
    fn a_family_by_hand() {
        let tests = family(&[(0.01, 0.001), (0.03, 0.002), (0.5, 0.25), (1.0, 0.5)]);
        assert_eq!(tarone_holm(&tests), [0.02, 0.03, 1.0, 1.0]);
        assert_eq!(rejected(&tests, 0.05), [true, true, false, false]);
        assert_eq!(holm(&[0.01, 0.03, 0.5, 1.0]), [0.04, 0.09, 1.0, 1.0]);
        assert!(tarone_holm(&[]).is_empty());
    }

    fn familywise_error(trials: &[u32], level: Ratio, alpha: f64) -> f64 {
        let mut all = vec![(Vec::new(), 1.0)];
        for &n in trials {
            let least = chance::least_p(n.into(), level).unwrap();
            let outcomes: Vec<(Attained, f64)> = (0..=n)
                .map(|k| {
                    let p = chance::two_sided(k.into(), n.into(), level).unwrap();
                    (Attained { p, least }, probability(k, n, level.value()))
                })
                .collect();
            let with = |(before, weight): &(Vec<Attained>, f64), (test, probability): (Attained, f64)| {
                (before.iter().copied().chain([test]).collect(), weight * probability)
            };
            all = all.iter().flat_map(|before| outcomes.iter().map(move |&next| with(before, next))).collect();
        }
        all.iter().filter(|(tests, _)| rejected(tests, alpha).contains(&true)).map(|(_, weight)| weight).sum()
    }

    fn probability(k: u32, n: u32, rate: f64) -> f64 {
        let choices = (0..k).fold(1.0, |c, j| c * f64::from(n - j) / f64::from(j + 1));
        choices * rate.powi(k.cast_signed()) * (1.0 - rate).powi((n - k).cast_signed())
    }

    #[test]
    fn the_error_of_the_family_is_at_most_the_level() {
        let mut largest = 0.0f64;
        for trials in [[3, 3, 3, 3], [2, 4, 6, 8], [1, 1, 9, 12], [5, 6, 7, 12], [7, 7, 7, 7]] {
            for (a, b) in [(1, 2), (1, 3), (1, 10)] {
                for alpha in [0.01, 0.05, 0.1, 0.2] {
                    let error = familywise_error(&trials, Ratio::new(a, b).unwrap(), alpha);
                    assert!(error <= alpha + 1e-12, "{trials:?} at {a}/{b}: {error} for {alpha}");
                    largest = largest.max(error / alpha);
                }
            }
        }
        assert!(largest > 0.5, "the levels are used: {largest}");
    }

    proptest! {
        #[test]
        fn between_holm_and_the_p_values(tests in prop::collection::vec((0.0f64..=1.0, 0.0f64..=1.0), 1..12), level in 0.001f64..0.5) {
            let tests: Vec<_> = tests.into_iter().map(|(p, part)| Attained { p, least: p * part }).collect();
            let by_holm = holm(&tests.iter().map(|test| test.p).collect::<Vec<_>>());
            let adjusted = tarone_holm(&tests);
            let found = rejected(&tests, level);
            let literal = by_tarones_rule(&tests, level);
            for index in 0..tests.len() {
                prop_assert!(tests[index].p <= adjusted[index] && adjusted[index] <= by_holm[index]);
                prop_assert!(by_holm[index] > level || found[index], "whatever Holm rejects");
                prop_assert!(!literal[index] || found[index], "whatever Tarone's own rule rejects");
            }
        }
    }
}
