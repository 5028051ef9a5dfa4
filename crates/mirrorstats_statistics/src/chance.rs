//! One rate against a level fixed beforehand: the exact binomial test.
//!
//! Rule: two-sided by probability, as in [`super::outcomes`]. Weights are integers as long as they fit 128 bits, which
//! distinguishes equal from nearly equal probabilities without rounding.

use std::iter::successors;

use super::outcomes::{ExactTest, Outcomes};
use mirrorstats_exact::ratio::Ratio;

/// With more trials, weights never fit 128 bits.
const MOST_EXACT: u64 = 128;

/// The two-sided p value of `successes` in `n` trials under the rate `level`; 0 if it underflows. `None` for n = 0, for
/// more successes than trials, and for a level outside [0, 1].
pub fn two_sided(successes: u64, n: u64, level: Ratio) -> Option<f64> {
    exact_test(successes, n, level).map(|test| test.p)
}

/// The p value of [`two_sided`] and its mid-p value. `None` as in [`two_sided`].
pub fn exact_test(successes: u64, n: u64, level: Ratio) -> Option<ExactTest> {
    let odds = Odds::of(level).filter(|_| n > 0 && successes <= n)?;
    Some(exact(successes, n, odds).unwrap_or_else(|| by_recurrence(n, odds).test(successes)))
}

/// The least p value that [`two_sided`] can give for `n` trials; 0 if it underflows, and for a level of 0 or 1. `None`
/// for n = 0 and for a level outside [0, 1].
pub fn least_p(n: u64, level: Ratio) -> Option<f64> {
    let odds = Odds::of(level).filter(|_| n > 0)?;
    let ends = exact(0, n, odds).zip(exact(n, n, odds));
    Some(ends.map_or_else(|| by_recurrence(n, odds).least_p(), |(none, all)| none.p.min(all.p)))
}

/// `hit` to `miss`: the level 1/3 is 1 to 2.
#[derive(Clone, Copy)]
pub(crate) struct Odds {
    pub hit: u64,
    pub miss: u64,
}

impl Odds {
    /// `None` outside [0, 1].
    pub fn of(level: Ratio) -> Option<Self> {
        let hit = u64::try_from(level.numerator()).ok()?;
        let all = u64::try_from(level.denominator()).ok()?;
        Some(Self { hit, miss: all.checked_sub(hit)? })
    }
}

/// The test in integers; `None` if a weight does not fit 128 bits.
fn exact(successes: u64, n: u64, odds: Odds) -> Option<ExactTest> {
    let (weights, total) = exact_weights(n, odds)?;
    let seen = weights[usize::try_from(successes).ok()?];
    let as_extreme: u128 = weights.iter().filter(|&&weight| weight <= seen).sum();
    let tied: u128 = weights.iter().filter(|&&weight| weight == seen).sum();
    let p = as_extreme as f64 / total as f64;
    // At a level of 0 or 1 only one count is possible, and it is no evidence.
    let mid_p = if seen == total { 1.0 } else { (as_extreme as f64 - tied as f64 / 2.0) / total as f64 };
    Some(ExactTest { p, mid_p })
}

/// Counts weigh `C(n, j) * hit^j * miss^(n - j)`; and their sum. `None` if one does not fit 128 bits.
fn exact_weights(n: u64, odds: Odds) -> Option<(Vec<u128>, u128)> {
    if n > MOST_EXACT {
        return None;
    }
    let powers = |base: u64| successors(Some(1u128), move |power| power.checked_mul(base.into()));
    let length = usize::try_from(n).ok()?.checked_add(1)?;
    let (hits, misses): (Vec<u128>, Vec<u128>) = powers(odds.hit).zip(powers(odds.miss)).take(length).unzip();
    if hits.len() < length {
        return None;
    }
    let mut choices = 1u128;
    let mut weights = Vec::with_capacity(length);
    for (j, (hit, miss)) in (0..=n).zip(hits.iter().zip(misses.iter().rev())) {
        weights.push(choices.checked_mul(*hit)?.checked_mul(*miss)?);
        choices = choices.checked_mul((n - j).into())? / u128::from(j + 1);
    }
    Some((weights, u128::from(odds.hit + odds.miss).checked_pow(u32::try_from(n).ok()?)?))
}

/// The same with weights relative to the most probable count, for any `n`.
fn by_recurrence(n: u64, odds: Odds) -> Outcomes {
    let all = u128::from(odds.hit) + u128::from(odds.miss);
    let mode = u64::try_from((u128::from(n) + 1) * u128::from(odds.hit) / all).unwrap_or(n).min(n);
    // The probability of `j + 1` successes in `n` trials divided by that of `j`.
    let rise = |j: u64| ((n - j) as f64 * odds.hit as f64) / ((j + 1) as f64 * odds.miss as f64);
    Outcomes::around(mode, (0, n), rise)
}

#[cfg(test)]
mod tests {
    use super::{Odds, by_recurrence, exact_test, least_p, two_sided};
    use crate::outcomes::ExactTest;
    use mirrorstats_exact::ratio::Ratio;

    fn level(above: i64, below: i64) -> Ratio {
        Ratio::new(above, below).unwrap()
    }

    // Python: F = Fraction; P[j] = F(comb(n, j) * a**j * (b - a)**(n - j), b**n); sum(p for p in P if p <= P[k]). scipy
    // 1.17.1 stats.binomtest(k, n, a / b).pvalue agrees in all its digits.
    #[test]
    fn p_values_match_known_values() {
        for (k, n, (a, b), expected) in [
            (5, 21, (1, 3), 0.488_521_635_152_284_8),
            (13, 21, (1, 3), 0.009_113_064_649_926_048),
            (0, 21, (1, 3), 0.000_272_992_980_694_095_6),
            (21, 21, (1, 3), 9.559_906_635_974_805e-11),
            (7, 21, (1, 3), 1.0),
            (3, 21, (1, 10), 0.461_010_164_648_476_2),
            (6, 21, (1, 11), 0.009_224_005_239_326_12),
            (40, 100, (1, 3), 0.168_092_029_398_926_9),
            (260, 700, (1, 3), 0.033_616_071_938_623_17),
            (500, 1000, (1, 2), 1.0),
            (530, 1000, (1, 2), 0.062_023_195_098_363_18),
        ] {
            let found = two_sided(k, n, level(a, b)).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-12, "{k}/{n} against {a}/{b}: {found}, expected {expected}");
        }
    }

    #[test]
    fn the_recurrence_agrees_with_the_integers() {
        for n in 1..=35 {
            for k in 0..=n {
                for (a, b) in [(1, 3), (1, 2), (1, 10), (9, 10)] {
                    let odds = Odds { hit: a, miss: b - a };
                    let exact = super::exact(k, n, odds).unwrap();
                    let found = by_recurrence(n, odds).test(k);
                    let near = |found: f64, exact: f64| (found / exact - 1.0).abs() < 1e-11;
                    let is_near = near(found.p, exact.p) && near(found.mid_p, exact.mid_p);
                    assert!(is_near, "{k}/{n} against {a}/{b}: {found:?}, {exact:?}");
                }
            }
        }
    }

    // Python: the fractions above, sum(p for p in P if p < P[k]) + sum(p for p in P if p == P[k]) / 2
    #[test]
    fn mid_p_values_match_known_values() {
        for (k, n, (a, b), expected) in [
            (5, 21, (1, 3), 0.424_776_557_040_700_16),
            (13, 21, (1, 3), 0.006_623_022_536_192_27),
            (0, 21, (1, 3), 0.000_172_750_094_086_856_44),
            (3, 21, (1, 10), 0.361_197_232_175_971_7),
            (40, 100, (1, 3), 0.152_716_573_236_668_46),
            (260, 700, (1, 3), 0.031_965_076_010_794_444),
            (530, 1000, (1, 2), 0.057_850_522_371_686_69),
        ] {
            let found = exact_test(k, n, level(a, b)).unwrap().mid_p;
            assert!((found / expected - 1.0).abs() < 1e-10, "{k}/{n} against {a}/{b}: {found}, expected {expected}");
        }
    }

    // Python: the smallest of these p values over all counts.
    #[test]
    fn least_p_values_match_known_values() {
        for (n, (a, b), expected) in [
            (1, (1, 3), 1.0 / 3.0),
            (3, (1, 3), 1.0 / 27.0),
            (21, (1, 3), 9.559_906_635_974_805e-11),
            (21, (1, 2), 9.536_743_164_062_5e-7),
            (21, (1, 10), 1e-21),
            (5, (9, 10), 1e-5),
            (200, (1, 3), 3.764_861_949_599_026e-96),
        ] {
            let found = least_p(n, level(a, b)).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-10, "{n} against {a}/{b}: {found}, expected {expected}");
        }
        assert_eq!([least_p(3, level(0, 1)), least_p(300, level(1, 1))], [Some(0.0); 2]);
        assert_eq!([least_p(0, level(1, 3)), least_p(3, level(4, 3))], [None; 2]);
    }

    #[test]
    fn swapping_successes_and_failures_keeps_the_p_value() {
        for k in 0..=21 {
            assert_eq!(two_sided(k, 21, level(1, 3)), two_sided(21 - k, 21, level(2, 3)));
            assert!((0.0..=1.0).contains(&two_sided(k, 21, level(1, 3)).unwrap()));
        }
    }

    #[test]
    fn a_level_of_zero_or_one_is_refuted_by_one_exception() {
        assert_eq!(two_sided(0, 5, level(0, 1)), Some(1.0));
        assert_eq!(two_sided(1, 5, level(0, 1)), Some(0.0));
        assert_eq!(two_sided(5, 5, level(1, 1)), Some(1.0));
        assert_eq!(two_sided(4, 5, level(1, 1)), Some(0.0));
        assert_eq!(two_sided(1000, 1000, level(1, 1)), Some(1.0));
        assert_eq!(two_sided(999, 1000, level(1, 1)), Some(0.0));
        for n in [5, 1000] {
            assert_eq!(exact_test(0, n, level(0, 1)), Some(ExactTest { p: 1.0, mid_p: 1.0 }));
            assert_eq!(exact_test(1, n, level(0, 1)), Some(ExactTest { p: 0.0, mid_p: 0.0 }));
        }
    }

    #[test]
    fn an_impossible_test_has_no_p_value() {
        for (k, n, level) in [(0, 0, level(1, 3)), (2, 1, level(1, 3)), (1, 2, level(4, 3)), (1, 2, level(-1, 3))] {
            assert_eq!(two_sided(k, n, level), None);
        }
    }
}
