//! One rate against a level fixed beforehand: the exact binomial test.
//!
//! Rule: two-sided by probability. The p value sums every count that is at most as probable as the one
//! seen (Gibbons and Pratt 1975, the minimum likelihood rule). Weights are integers while 128 bits hold
//! them, so that counts of equal probability are told apart from nearly equal ones without rounding.

use std::iter::successors;

use crate::base::ratio::Ratio;

/// Beyond exact weights, how near two weights count as equal.
const TIE: f64 = 1e-12;

/// No weights of more trials than this fit 128 bits.
const MOST_EXACT: u64 = 128;

/// The two-sided p value of `successes` in `n` trials under the rate `level`.
///
/// `None` for n = 0, for more successes than trials, and for a level outside [0, 1].
/// A p value below the smallest floating-point number is 0.
pub fn two_sided(successes: u64, n: u64, level: Ratio) -> Option<f64> {
    let hit = u64::try_from(level.numerator()).ok()?;
    let all = u64::try_from(level.denominator()).ok()?;
    let odds = Odds { hit, miss: all.checked_sub(hit)? };
    if n == 0 || successes > n {
        return None;
    }
    Some(exact(successes, n, odds).unwrap_or_else(|| by_recurrence(successes, n, odds)))
}

/// `hit` to `miss`: the level 1/3 is 1 to 2.
#[derive(Clone, Copy)]
struct Odds {
    hit: u64,
    miss: u64,
}

/// Counts weigh `C(n, j) * hit^j * miss^(n - j)`; `None` where a weight leaves 128 bits.
#[expect(clippy::cast_precision_loss, reason = "two exact sums become one quotient here")]
fn exact(successes: u64, n: u64, odds: Odds) -> Option<f64> {
    let weights = exact_weights(n, odds)?;
    let seen = weights[usize::try_from(successes).ok()?];
    let total: u128 = u128::from(odds.hit + odds.miss).checked_pow(u32::try_from(n).ok()?)?;
    let as_extreme: u128 = weights.iter().filter(|&&weight| weight <= seen).sum();
    Some(as_extreme as f64 / total as f64)
}

fn exact_weights(n: u64, odds: Odds) -> Option<Vec<u128>> {
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
    Some(weights)
}

/// The same with weights relative to the most probable count, by the ratios of neighbours.
fn by_recurrence(successes: u64, n: u64, odds: Odds) -> f64 {
    let weights = relative_weights(n, odds);
    let seen = weights.iter().find(|(count, _)| *count == successes).map_or(0.0, |(_, weight)| *weight);
    let limit = seen * (1.0 + TIE);
    let as_extreme: f64 = weights.iter().map(|(_, weight)| weight).filter(|weight| **weight <= limit).sum();
    let total: f64 = weights.iter().map(|(_, weight)| weight).sum();
    as_extreme / total
}

/// Counts with their weights, the mode's being 1; what underflows is left out.
#[expect(clippy::cast_precision_loss, reason = "relative weights are approximate by design")]
fn relative_weights(n: u64, odds: Odds) -> Vec<(u64, f64)> {
    let all = u128::from(odds.hit) + u128::from(odds.miss);
    let mode = (u128::from(n) + 1) * u128::from(odds.hit) / all;
    let mode = u64::try_from(mode).unwrap_or(n).min(n);
    let (hit, miss) = (odds.hit as f64, odds.miss as f64);
    let down = successors(Some((mode, 1.0)), |&(j, weight)| {
        (j > 0).then(|| (j - 1, weight * (j as f64 * miss) / ((n - j + 1) as f64 * hit)))
    });
    let up = successors(Some((mode, 1.0)), |&(j, weight)| {
        (j < n).then(|| (j + 1, weight * ((n - j) as f64 * hit) / ((j + 1) as f64 * miss)))
    });
    let seen = |(_, weight): &(u64, f64)| *weight > 0.0;
    down.take_while(seen).chain(up.skip(1).take_while(seen)).collect()
}

#[cfg(test)]
mod tests {
    use super::{Odds, by_recurrence, two_sided};
    use crate::base::ratio::Ratio;

    fn level(above: i64, below: i64) -> Ratio {
        Ratio::new(above, below).unwrap()
    }

    // Python: F = Fraction; P[j] = F(comb(n, j) * a**j * (b - a)**(n - j), b**n); sum(p for p in P if p <= P[k]).
    // scipy 1.17.1 stats.binomtest(k, n, a / b).pvalue agrees in all digits it gives.
    #[test]
    fn p_values_are_the_known_ones() {
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
                    let found = by_recurrence(k, n, odds);
                    assert!((found / exact - 1.0).abs() < 1e-11, "{k}/{n} against {a}/{b}: {found}, {exact}");
                }
            }
        }
    }

    #[test]
    fn counting_failures_instead_changes_nothing() {
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
    }

    #[test]
    fn what_is_no_test_has_no_p_value() {
        for (k, n, level) in [(0, 0, level(1, 3)), (2, 1, level(1, 3)), (1, 2, level(4, 3)), (1, 2, level(-1, 3))] {
            assert_eq!(two_sided(k, n, level), None);
        }
    }
}
