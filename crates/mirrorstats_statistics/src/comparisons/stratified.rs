//! Two independent rates in several strata (experiments): their common difference, and a test of no difference.
//!
//! Rule: sides are compared only within a stratum, so unequal difficulty and size of strata do not confound them. A
//! stratum without episodes of one side is left out. Paired episodes belong to [`pooled`].

use crate::comparisons::paired::Pairs;
use crate::comparisons::unpaired::tables;
use crate::intervals::interval::Interval;
use crate::intervals::quantile;
use crate::outcomes::{ExactTest, Outcomes};

/// The most multiplications of the exact test: a fraction of a second.
const MOST_PRODUCTS: usize = 1 << 24;

/// One stratum: the successes and the episodes of each side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stratum {
    /// The successes and the episodes of the first.
    pub first: (u64, u64),
    /// The successes and the episodes of the second.
    pub second: (u64, u64),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonDifference {
    /// The first rate minus the second, averaged over the strata with the weights m n / (m + n).
    pub difference: f64,
    /// Its interval; `None` where the strata leave no spread to judge by.
    pub interval: Option<Interval>,
}

/// The common difference of the rates (Greenland and Robins 1985) and its score interval (Klingenberg 2014, Statistics
/// in Medicine 33:2968), which inverts the test with Sato's variance (Sato 1989): (slope d + constant) / weight² at a
/// difference d. `None` if no stratum has episodes of both sides, if a stratum has more successes than episodes, and
/// for a confidence outside (0, 1).
pub fn common_difference(strata: &[Stratum], confidence: f64) -> Option<CommonDifference> {
    let deviate = quantile::normal(quantile::tail(confidence)?);
    let [mut weight, mut excess, mut slope, mut constant] = [0.0; 4];
    for Stratum { first, second } in comparable(strata)? {
        let [x, m, y, n] = [first.0, first.1, second.0, second.1].map(|count| count as f64);
        let all = m + n;
        weight += m * n / all;
        excess += (x * n - y * m) / all;
        slope += (m * m * y - n * n * x + m * n * (n - m) / 2.0) / (all * all);
        constant += (x * (n - y) + y * (m - x)) / (2.0 * all);
    }
    let difference = excess / weight;
    let scale = deviate * deviate / (weight * weight);
    let middle = difference + scale * slope / 2.0;
    let reach = (middle * middle - difference * difference + scale * constant).max(0.0).sqrt();
    let bounds = Interval { low: middle - reach, high: middle + reach }.within(-1.0, 1.0);
    Some(CommonDifference { difference, interval: (bounds.low < bounds.high).then_some(bounds) })
}

/// The exact conditional test of no difference in any stratum. Given each stratum's margins, the successes of the first
/// side are a sum of hypergeometric counts (Mehta, Patel and Gray 1985). Two-sided by minimum likelihood. `mid_p` is
/// less conservative and not guaranteed to keep the level. `None` as in [`common_difference`], and if the sum has too
/// many values: the asymptotic test then serves better.
pub fn exact(strata: &[Stratum]) -> Option<ExactTest> {
    let strata = comparable(strata)?;
    let seen = strata.iter().map(|stratum| stratum.first.0).sum();
    let all: Option<Vec<Outcomes>> = strata.iter().map(|stratum| tables(stratum.first, stratum.second)).collect();
    let mut all = all?.into_iter();
    let mut sum = all.next()?;
    let mut products = 0usize;
    for next in all {
        products = products.saturating_add(sum.len().saturating_mul(next.len()));
        if products > MOST_PRODUCTS {
            return None;
        }
        sum = sum.plus(&next);
    }
    Some(sum.test(seen))
}

/// The pairs of all strata in one table: for matched pairs, its [`Pairs::mcnemar`] is the exact conditional test. Each
/// pair is a stratum of its own within any larger stratum. Given the margins, a concordant pair is fixed and a
/// discordant one favours either side with probability 1/2. So pooling loses nothing.
pub fn pooled(strata: &[Pairs]) -> Pairs {
    strata.iter().fold(Pairs::default(), |sum, pairs| Pairs {
        both: sum.both + pairs.both,
        first_only: sum.first_only + pairs.first_only,
        second_only: sum.second_only + pairs.second_only,
        neither: sum.neither + pairs.neither,
    })
}

/// The strata with episodes of both sides; `None` without any, or if one has more successes than episodes.
fn comparable(strata: &[Stratum]) -> Option<Vec<Stratum>> {
    if strata.iter().any(|stratum| stratum.first.0 > stratum.first.1 || stratum.second.0 > stratum.second.1) {
        return None;
    }
    let has_both = |stratum: &Stratum| stratum.first.1 > 0 && stratum.second.1 > 0;
    let found: Vec<Stratum> = strata.iter().copied().filter(has_both).collect();
    (!found.is_empty()).then_some(found)
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use proptest::prelude::*;

    use super::{Stratum, common_difference, exact, pooled};
    use crate::comparisons::paired::Pairs;
    use crate::comparisons::unpaired::fisher;

    type Counts = ((u64, u64), (u64, u64));

    const THREE: [Counts; 3] = [((15, 21), (9, 21)), ((12, 21), (8, 20)), ((18, 21), (14, 19))];
    const SPARSE: [Counts; 4] = [((1, 2), (0, 3)), ((2, 2), (1, 4)), ((0, 1), (0, 2)), ((3, 4), (1, 3))];
    const OPPOSITE: [Counts; 2] = [((21, 21), (0, 21)), ((7, 7), (0, 9))];
    /// Admissions of men and women at Berkeley in 1973 by department, from R's `UCBAdmissions`.
    const BERKELEY: [Counts; 6] = [
        ((512, 825), (89, 108)),
        ((353, 560), (17, 25)),
        ((120, 325), (202, 593)),
        ((138, 417), (131, 375)),
        ((53, 191), (94, 393)),
        ((22, 373), (24, 341)),
    ];

    fn strata(counts: &[Counts]) -> Vec<Stratum> {
        counts.iter().map(|&(first, second)| Stratum { first, second }).collect()
    }

    fn close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-9, "found {found}, expected {expected}");
    }

    // Python: fractions for the sums, scipy 1.17.1 brentq for the roots of (d - x)² = z² (slope x + constant) / weight².
    #[test]
    fn the_common_difference_matches_known_values() {
        for (counts, difference, low, high) in [
            (&THREE[..], 0.19389031143929017, 0.025098064301969435, 0.3511478414166653),
            (&SPARSE, 0.47093023255813954, 0.019775569362376663, 0.7580276416446508),
            (&[((56, 70), (48, 80))], 0.2, 0.05155486778686341, 0.33678356079317234),
            (&BERKELEY, -0.018425196190852512, -0.047366881345320196, 0.010748058332670306),
            (&OPPOSITE, 1.0, 0.8669624650841862, 1.0),
        ] {
            let found = common_difference(&strata(counts), 0.95).unwrap();
            let interval = found.interval.unwrap();
            close(found.difference, difference);
            close(interval.low, low);
            close(interval.high, high);
        }
    }

    // Python: fractions, convolution of the strata's hypergeometric probabilities.
    #[test]
    fn the_exact_test_matches_known_values() {
        for (counts, p, mid_p) in [
            (&THREE[..], 0.0348427546215399, 0.02902267571595362),
            (&SPARSE, 0.053714285714285714, 0.03485714285714286),
            (&OPPOSITE, 1.623990870612546e-16, 8.11995435306273e-17),
        ] {
            let found = exact(&strata(counts)).unwrap();
            assert!((found.p / p - 1.0).abs() < 1e-9 && (found.mid_p / mid_p - 1.0).abs() < 1e-9, "{found:?}");
        }
        let one = strata(&[((8, 10), (1, 6))]);
        assert_eq!(exact(&one), fisher((8, 10), (1, 6)));
    }

    #[test]
    fn empty_strata_have_no_answer_and_no_width_gives_no_interval() {
        let lone = strata(&[((1, 2), (0, 0)), ((0, 0), (3, 4))]);
        assert_eq!((common_difference(&lone, 0.95), exact(&lone)), (None, None));
        let wrong = strata(&[((3, 2), (1, 2))]);
        assert_eq!((common_difference(&wrong, 0.95), exact(&wrong)), (None, None));
        let never = strata(&[((0, 7), (0, 7)), ((0, 3), (0, 3))]);
        let found = common_difference(&never, 0.95).unwrap();
        assert_eq!((found.difference, found.interval), (0.0, None));
        assert_eq!(exact(&never).map(|test| (test.p, test.mid_p)), Some((1.0, 1.0)));
        assert_eq!(common_difference(&strata(&THREE), 1.0), None);
    }

    #[test]
    fn a_stratum_of_one_side_changes_nothing() {
        let mut more = strata(&THREE);
        more.push(Stratum { first: (3, 7), second: (0, 0) });
        assert_eq!(common_difference(&more, 0.95), common_difference(&strata(&THREE), 0.95));
        assert_eq!(exact(&more), exact(&strata(&THREE)));
    }

    #[test]
    fn very_many_episodes_have_no_exact_test() {
        let many = strata(&[((250_000, 500_000), (250_100, 500_000)); 60]);
        assert_eq!(exact(&many), None);
        assert!(common_difference(&many, 0.95).is_some());
    }

    // With each pair as its own stratum, the exact conditional test is McNemar's over the discordant pairs.
    #[test]
    fn pairs_as_strata_are_mcnemars_test() {
        let experiments = [
            Pairs { both: 5, first_only: 6, second_only: 1, neither: 3 },
            Pairs { both: 2, first_only: 4, second_only: 2, neither: 1 },
        ];
        let together = pooled(&experiments);
        assert_eq!(together, Pairs { both: 7, first_only: 10, second_only: 3, neither: 4 });
        let single = |(x, y): (u64, u64), count: u64| (0..count).map(move |_| ((x, 1), (y, 1)));
        let each: Vec<Counts> = experiments
            .iter()
            .flat_map(|pairs| {
                let concordant = single((1, 1), pairs.both).chain(single((0, 0), pairs.neither));
                concordant.chain(single((1, 0), pairs.first_only)).chain(single((0, 1), pairs.second_only))
            })
            .collect();
        let found = exact(&strata(&each)).unwrap();
        assert!((found.p - together.mcnemar().unwrap()).abs() < 1e-12);
        assert!((found.mid_p - together.test().unwrap().mid_p).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn swapping_the_sides_negates_the_difference(counts in prop::collection::vec(prop::array::uniform4(0u64..12), 1..5)) {
            let here: Vec<Stratum> = counts
                .iter()
                .map(|&[a, b, c, d]| Stratum { first: (a, a + b + 1), second: (c, c + d + 1) })
                .collect();
            let there: Vec<Stratum> =
                here.iter().map(|stratum| Stratum { first: stratum.second, second: stratum.first }).collect();
            let (a, b) = (common_difference(&here, 0.95).unwrap(), common_difference(&there, 0.95).unwrap());
            prop_assert!((a.difference + b.difference).abs() < 1e-12);
            if let (Some(a), Some(b)) = (a.interval, b.interval) {
                prop_assert!((a.low + b.high).abs() < 1e-9 && (a.high + b.low).abs() < 1e-9);
            }
            prop_assert!(a.interval.is_none_or(|interval| interval.low - 1e-12 <= a.difference && a.difference <= interval.high + 1e-12));
            let (a, b) = (exact(&here).unwrap(), exact(&there).unwrap());
            prop_assert!((a.p - b.p).abs() < 1e-9 && 0.0 < a.p && a.p <= 1.0 && a.mid_p <= a.p);
        }
    }
}
