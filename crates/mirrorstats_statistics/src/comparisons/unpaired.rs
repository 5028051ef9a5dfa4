//! Two samples of different episodes: Fisher's exact test of two rates, intervals of a difference of rates or means.
//!
//! Rule: in the test the total number of successes is fixed; it asks how they are divided between the two sides.

use crate::intervals::interval::{Interval, student_t_of, wilson};
use crate::outcomes::{ExactTest, Outcomes};
use mirrorstats_exact::moments::{Moments, StandardError};

/// Fisher's exact test of no difference between two independent rates, two-sided by minimum likelihood (Fisher 1935;
/// Gibbons and Pratt 1975), each as successes of episodes. `mid_p` is less conservative and not guaranteed to keep the
/// level. Both are 1 if all episodes or no episodes succeed. `None` if a side has no episodes, or more successes than
/// episodes. The cost grows with the square root of the counts: about ten thousand steps for a million episodes.
pub fn fisher(first: (u64, u64), second: (u64, u64)) -> Option<ExactTest> {
    Some(tables(first, second)?.test(first.0))
}

/// The possible successes of the first side given the margins: the hypergeometric distribution. `None` if a side has no
/// episodes, or more successes than episodes.
pub(crate) fn tables((k, m): (u64, u64), (l, n): (u64, u64)) -> Option<Outcomes> {
    if m == 0 || n == 0 || k > m || l > n {
        return None;
    }
    let all = k + l;
    let (low, high) = (all.saturating_sub(n), m.min(all));
    let mode = (u128::from(m) + 1) * (u128::from(all) + 1) / (u128::from(m) + u128::from(n) + 2);
    let mode = u64::try_from(mode).unwrap_or(high).clamp(low, high);
    let rise = |a: u64| {
        let (free, missing) = ((m - a) as f64, (all - a) as f64);
        free * missing / ((a + 1) as f64 * ((n + a + 1) - all) as f64)
    };
    Some(Outcomes::around(mode, (low, high), rise))
}

/// The interval of a difference of two independent rates, the first minus the second: square and add (Newcombe 1998,
/// Statistics in Medicine 17:873, method 10). `None` if either rate has no interval.
pub fn newcombe(first: (u64, u64), second: (u64, u64), confidence: f64) -> Option<Interval> {
    let (a, b) = (wilson(first.0, first.1, confidence)?, wilson(second.0, second.1, confidence)?);
    let (p, q) = (first.0 as f64 / first.1 as f64, second.0 as f64 / second.1 as f64);
    let reach = |x: f64, y: f64| (x * x + y * y).sqrt();
    Some(Interval {
        low: (p - q - reach(p - a.low, b.high - q)).max(-1.0),
        high: (p - q + reach(a.high - p, q - b.low)).min(1.0),
    })
}

/// The interval of a difference of two independent means, variances unequal (Welch 1938; degrees of freedom by
/// Satterthwaite 1946). Always from sample standard errors. `None` if either side has fewer than two values, or if
/// neither has a spread.
pub fn welch(first: &Moments, second: &Moments, confidence: f64) -> Option<Interval> {
    let difference = first.mean()? - second.mean()?;
    let part = |moments: &Moments| moments.se(StandardError::Sample).map(|se| (se * se, (moments.n - 1) as f64));
    let (variance, freedom) = satterthwaite([part(first)?, part(second)?]);
    student_t_of(difference, variance.sqrt(), freedom, confidence)
}

/// The variance of a difference and its degrees of freedom, from the values of both sides (Satterthwaite 1946).
pub(crate) fn satterthwaite(sides: [(f64, f64); 2]) -> (f64, f64) {
    let variance: f64 = sides.iter().map(|(variance, _)| variance).sum();
    let parts: f64 = sides.iter().map(|(variance, freedom)| variance * variance / freedom).sum();
    (variance, variance * variance / parts)
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use proptest::prelude::*;

    use super::{Interval, fisher, newcombe, tables, welch};
    use mirrorstats_exact::moments::Moments;

    /// The least p value that [`fisher`] can give with these numbers of episodes and this total of successes.
    fn fisher_least_p(first: (u64, u64), second: (u64, u64)) -> Option<f64> {
        Some(tables(first, second)?.least_p())
    }

    fn close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-9, "found {found}, expected {expected}");
    }

    // scipy 1.17.1: fisher_exact([[k1, n1 - k1], [k2, n2 - k2]]).pvalue. Mid-p and the least p of the margins:
    // Python fractions over the hypergeometric probabilities comb(n1, a) * comb(n2, K - a) / comb(n1 + n2, K).
    #[test]
    fn the_test_matches_known_values() {
        for (first, second, p, mid_p, least) in [
            ((8, 10), (1, 6), 0.03496503496503497, 0.023164335664335664, 0.0008741258741258741),
            ((3, 21), (12, 21), 0.00884048268676175, 0.004878617052712931, 1.0998817260517252e-06),
            ((0, 21), (6, 21), 0.020688606054459713, 0.010344303027229856, 0.020688606054459713),
            ((21, 21), (0, 21), 3.715691111961505e-12, 1.8578455559807526e-12, 3.715691111961505e-12),
            ((5, 21), (5, 21), 1.0, 0.8592939690500666, 0.000479415113561455),
            ((1, 3), (2, 50), 0.16332280372235977, 0.084884316571331, 4.268761205498164e-05),
            ((40, 300), (70, 310), 0.0031681599317477625, 0.002664887565892983, 4.601952883232522e-40),
        ] {
            let found = fisher(first, second).unwrap();
            close(found.p, p);
            close(found.mid_p, mid_p);
            close(fisher_least_p(first, second).unwrap(), least);
        }
    }

    // scipy 1.17.1: fisher_exact as above
    #[test]
    fn millions_of_episodes_neither_overflow_nor_take_long() {
        close(fisher((500_000, 1_000_000), (501_000, 1_000_000)).unwrap().p, 0.1577145048697666);
        close(fisher((300, 1_000_000), (400, 900_000)).unwrap().p, 2.4297562639097583e-07);
        close(fisher((100_000, 1_000_000), (1000, 20_000)).unwrap().p, 8.368481170116568e-145);
        let opposite = fisher((1_000_000, 1_000_000), (0, 1_000_000)).unwrap();
        assert_eq!((opposite.p, fisher_least_p((1_000_000, 1_000_000), (0, 1_000_000))), (0.0, Some(0.0)));
    }

    #[test]
    fn equal_sides_are_no_evidence_and_an_invalid_table_has_no_test() {
        for (first, second) in [((0, 5), (0, 7)), ((5, 5), (7, 7))] {
            let found = fisher(first, second).unwrap();
            assert_eq!((found.p, found.mid_p, fisher_least_p(first, second)), (1.0, 1.0, Some(1.0)));
        }
        for (first, second) in [((0, 0), (1, 2)), ((1, 2), (0, 0)), ((3, 2), (1, 2)), ((1, 2), (3, 2))] {
            assert_eq!((fisher(first, second), fisher_least_p(first, second)), (None, None));
        }
    }

    proptest! {
        #[test]
        fn exchanging_sides_or_outcomes_changes_nothing(m in 1u64..40, n in 1u64..40, a in 0u64..40, b in 0u64..40) {
            prop_assume!(a <= m && b <= n);
            let here = fisher((a, m), (b, n)).unwrap();
            for there in [fisher((b, n), (a, m)).unwrap(), fisher((m - a, m), (n - b, n)).unwrap()] {
                prop_assert!((here.p - there.p).abs() < 1e-12 && (here.mid_p - there.mid_p).abs() < 1e-12);
            }
            prop_assert!(0.0 < here.p && here.p <= 1.0 && here.mid_p <= here.p && here.mid_p >= here.p / 2.0);
            prop_assert!(fisher_least_p((a, m), (b, n)).unwrap() <= here.p * (1.0 + 1e-9));
        }
    }

    fn of(values: &[i64]) -> Moments {
        values.iter().fold(Moments::default(), |m, &v| m.with(v).unwrap())
    }

    fn check(found: Option<Interval>, low: f64, high: f64) {
        let found = found.expect("defined");
        assert!((found.low - low).abs() < 1e-10 && (found.high - high).abs() < 1e-10, "{found:?}");
    }

    // statsmodels 0.15.0: confint_proportions_2indep(k1, n1, k2, n2, method="newcomb", compare="diff").
    // The first two are Newcombe's examples (a) and (c): 0.0524 to 0.3339, 0.1705 to 0.8090.
    #[test]
    fn newcombe_matches_known_values() {
        check(newcombe((56, 70), (48, 80), 0.95), 0.052431472402365, 0.333872654036906);
        check(newcombe((9, 10), (3, 10), 0.95), 0.170522723934503, 0.809017973535488);
        check(newcombe((21, 21), (0, 21), 0.95), 0.781307402164412, 1.0);
        check(newcombe((19, 21), (7, 21), 0.95), 0.283437968804294, 0.746835882580389);
        assert_eq!(newcombe((0, 0), (1, 2), 0.95), None);
    }

    // scipy 1.17.1: ttest_ind(x, y, equal_var=False).confidence_interval()
    #[test]
    fn welch_matches_known_values() {
        check(welch(&of(&[4, 8, 15, 16, 23, 42]), &of(&[3, 5, 9, 1]), 0.95), -0.657935919364713, 27.6579359193647);
        assert_eq!(welch(&of(&[1]), &of(&[1, 2]), 0.95), None);
        assert_eq!(welch(&of(&[3, 3]), &of(&[5, 5]), 0.95), None);
        assert!(welch(&of(&[3, 3]), &of(&[5, 6]), 0.95).is_some());
    }
}
