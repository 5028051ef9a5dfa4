//! An adjustment that Holm's replaced: tests that cannot reach significance take no share of the level.
//!
//! Rule: the least p value of each test must be fixed before the outcomes are known, or by what all tests of the family
//! condition on. Then the family's error is at most the level under any dependence: by design for binomial tests with
//! fixed numbers of trials, by conditioning for the tests of `McNemar` and Fisher over disjoint episodes. For
//! comparisons that share a model (A with B, A with C) one test's discordant pairs inform about the other, and no proof
//! exists; `benches/COVERAGE.md` shows the simulated error. Use exact p values only, because a mid-p value may be below
//! the least p value.

use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::comparisons::unpaired::fisher;

/// The tolerance for reaching a least p value, because the same number may be computed in different ways.
const TIE: f64 = 1e-12;

/// One exact test: its p value and its least possible p value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attained {
    /// The exact p value.
    pub p: f64,
    /// The least attainable p value, at most `p`: [`mirrorstats_statistics::chance::least_p`], [`mcnemar_least_p`],
    /// [`fisher_least_p`].
    pub least: f64,
}

/// The least p value that [`Pairs::mcnemar`] can give with d discordant pairs: 2^(1 - d), at most 1; `None` without
/// pairs.
pub fn mcnemar_least_p(pairs: Pairs) -> Option<f64> {
    let discordant = pairs.first_only + pairs.second_only;
    let halvings = i32::try_from(discordant.saturating_sub(1)).unwrap_or(i32::MAX);
    (pairs.n() > 0).then(|| 0.5f64.powi(halvings))
}

/// Python: the sum of comb(d, j) / 2**d over j = 0 and j = d.
pub fn check_mcnemar_least_p() {
    for (first_only, second_only, least) in [(0, 0, 1.0), (1, 0, 1.0), (5, 0, 0.0625), (8, 1, 0.003_906_25)] {
        let found = mcnemar_least_p(Pairs { both: 3, first_only, second_only, neither: 4 });
        assert_eq!(found, Some(least), "{first_only}-{second_only}");
    }
}

/// The least p value that [`fisher`] can give with these numbers of episodes and this total of successes.
pub fn fisher_least_p((k, m): (u64, u64), (l, n): (u64, u64)) -> Option<f64> {
    let all = k + l;
    let [fewest, most] = [all.saturating_sub(n), m.min(all)].map(|first| fisher((first, m), (all - first, n)));
    Some(fewest?.p.min(most?.p))
}

/// Adjusted p values in input order; a test is rejected if its value is at most the level.
///
/// Bonferroni's correction for those tests that can reach the p value at all (Tarone 1990, Biometrics 46:515), stepping
/// down like Holm. Tarone's own rule depends on the level: it may reject at 0.04 and not at 0.05. This one does not
/// (Hommel and Krummenauer 1998, Biometrics 54:673). In ascending order, the i-th p value is multiplied by the number
/// of tests from the i-th on whose least p value is not above it. No adjusted value exceeds that of
/// [`mirrorstats_statistics::comparisons::holm::holm`].
#[expect(clippy::cast_precision_loss, reason = "a family has few tests")]
pub fn tarone_holm(tests: &[Attained]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..tests.len()).collect();
    order.sort_by(|&a, &b| tests[a].p.total_cmp(&tests[b].p));
    let mut adjusted = vec![0.0; tests.len()];
    let mut reached = 0.0f64;
    for (rank, &index) in order.iter().enumerate() {
        let p = tests[index].p;
        // A test with the same p value always counts, even if rounding put its least p value above it.
        let can_reach = |&&other: &&usize| tests[other].least.min(tests[other].p) <= p * (1.0 + TIE);
        let count = order[rank..].iter().filter(can_reach).count();
        reached = reached.max((count as f64 * p).min(1.0));
        adjusted[index] = reached;
    }
    adjusted
}
