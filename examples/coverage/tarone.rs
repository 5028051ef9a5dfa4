//! The adjustment given up for Holm's: tests that could not have reached significance take no share of the level.
//!
//! Rule: the least p value of each test must be fixed before the outcomes are known, or given what all tests of the
//! family condition on together. Then the error of the family is at most the level, whatever the dependence:
//! by design for binomial tests of fixed numbers of trials, by conditioning for the tests of `McNemar` and Fisher over
//! disjoint episodes. For comparisons that share a model (A with B, A with C) the discordant pairs of one test tell of
//! the outcomes of another, and no proof holds; `benches/COVERAGE.md` shows the error that simulation finds.
//! Only exact p values belong here: a mid-p value may lie below the least p value.

/// The tolerance for a least p value that counts as reached: the same number may be computed in another way.
const TIE: f64 = 1e-12;

/// One exact test: its p value, and the least that it could have had.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attained {
    /// The exact p value.
    pub p: f64,
    /// The least attainable p value, at most `p`: [`statistics::chance::least_p`],
    /// [`statistics::paired::Pairs::mcnemar_least_p`], [`statistics::unpaired::fisher_least_p`].
    pub least: f64,
}

/// Adjusted p values, in the order of the input: those at most the level are rejected.
///
/// Bonferroni's correction for the tests that can reach the p value at all (Tarone 1990, Biometrics 46:515), stepping
/// down as Holm does, and without the dependence on the level by which Tarone's own rule may reject at 0.04
/// and not at 0.05 (Hommel and Krummenauer 1998, Biometrics 54:673). In ascending order the i-th p value is multiplied by
/// the number of tests from the i-th on whose least p value is not above it. No adjusted value exceeds
/// that of [`statistics::holm::holm`].
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
