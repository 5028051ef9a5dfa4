//! Rates over units of analysis, such as scenes, with several episodes each.
//!
//! Rule: the unit counts, not the episode. A unit enters as the mean of its episodes, an integer over a common
//! denominator. With one episode per unit, the tests are the binomial test and the test of `McNemar`.

use std::collections::BTreeMap;

use crate::chance::{exact_test, least_p};
use crate::outcomes::ExactTest;
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::ratio::Ratio;

const MOST_OUTCOMES: usize = 1 << 21;
const MOST_DENOMINATOR: i128 = 1 << 40;

/// A test over units: its estimate, its p value, and the least p value of any outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitTest {
    /// The score divided by its weight: the mean difference of shared units, and the difference of the means of the other
    /// units, weighted by their number of pairs and the harmonic mean of their sizes (Mantel and Haenszel 1959).
    pub difference: f64,
    pub p: f64,
    /// The least p value for the same number of units.
    pub least: f64,
}

/// The units of two sides, each with the sums of its episodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sides {
    pub shared: Vec<(Moments, Moments)>,
    pub first: Vec<Moments>,
    pub second: Vec<Moments>,
}

/// The binomial test of a rate over units. The count is the sum of their means, rounded towards the level. The sum
/// varies at most as much as one verdict per unit would; a fraction counts in favour of the level. `None` without units
/// and for a level outside [0, 1].
pub fn rate_test(units: &[Moments], level: Ratio) -> Option<(ExactTest, f64)> {
    let (values, denominator) = means(units)?;
    let n = u64::try_from(units.len()).ok()?;
    let sum: i128 = values.iter().sum();
    Some((rate_test_of_sum(sum, denominator, n, level)?, least_p(n, level)?))
}

/// The same test of `n` units from the sum of their means, `sum / denominator`.
pub(crate) fn rate_test_of_sum(sum: i128, denominator: i128, n: u64, level: Ratio) -> Option<ExactTest> {
    let (numerator, whole) = (i128::from(level.numerator()), i128::from(level.denominator()));
    let expected = numerator * i128::from(n);
    let is_above = sum * whole > expected * denominator;
    let count = if is_above { sum.div_euclid(denominator) } else { (sum + denominator - 1).div_euclid(denominator) };
    let crossed = if is_above { count * whole < expected } else { count * whole > expected };
    let test = exact_test(u64::try_from(count).ok()?, n, level)?;
    Some(if crossed { ExactTest { p: 1.0, mid_p: 1.0 } } else { test })
}

/// The exact permutation test of two rates: within each shared unit, and among the unshared units. The statistic is the
/// score: the first side's sum minus its expectation given the margins. `None` unless there is a shared unit or an
/// unshared unit on each side, and with too many outcomes to enumerate.
pub fn difference_test(Sides { shared, first, second }: &Sides) -> Option<UnitTest> {
    let all: Vec<Moments> =
        shared.iter().flat_map(|&(a, b)| [a, b]).chain(first.iter().chain(second).copied()).collect();
    let (values, denominator) = means(&all)?;
    let (pairs, pool) = values.split_at(2 * shared.len());
    let differences: Vec<i128> = pairs.chunks(2).map(|pair| pair[0] - pair[1]).collect();
    let is_pooled = !first.is_empty() && !second.is_empty();
    let pool = if is_pooled { pool } else { &[] };
    let drawn = if is_pooled { first.len() } else { 0 };
    if differences.is_empty() && pool.is_empty() {
        return None;
    }
    // Everything is scaled by twice the size of the pool, so that the expectation is an integer.
    let scale = pool.len().max(1) as i128;
    let expected = 2 * drawn as i128 * pool.iter().sum::<i128>();
    let score = |difference: i128, sum: i128| scale * difference + 2 * scale * sum - expected;
    let of_seen = score(differences.iter().sum(), pool[..drawn].iter().sum());
    let seen = of_seen.abs();
    let weight = scale * differences.len() as i128 + 2 * (drawn * (pool.len() - drawn)) as i128;
    let (signed, chosen) = (flips(&differences)?, draws(pool, drawn)?);
    if signed.len().checked_mul(chosen.len())? > MOST_OUTCOMES {
        return None;
    }
    let outcomes = || signed.iter().flat_map(|(d, a)| chosen.iter().map(move |(s, b)| (score(*d, *s).abs(), a * b)));
    let most = outcomes().map(|(score, _)| score).max()?;
    let beyond = |limit: i128| outcomes().filter(|(score, _)| *score >= limit).map(|(_, weight)| weight).sum::<f64>();
    let all = beyond(0);
    let difference = of_seen as f64 / (denominator * weight) as f64;
    Some(UnitTest { difference, p: beyond(seen) / all, least: beyond(most) / all })
}

/// The mean of the units' means; `None` without units.
pub fn mean(units: &[Moments]) -> Option<f64> {
    if let Some((values, denominator)) = means(units).filter(|(values, _)| !values.is_empty()) {
        return Some(values.iter().sum::<i128>() as f64 / (denominator * values.len() as i128) as f64);
    }
    let sum: f64 = units.iter().map(|unit| unit.mean()).sum::<Option<f64>>()?;
    (!units.is_empty()).then(|| sum / units.len() as f64)
}

fn means(units: &[Moments]) -> Option<(Vec<i128>, i128)> {
    let mut denominator: i128 = 1;
    for unit in units {
        let n = i128::from(unit.n);
        denominator = denominator / gcd(denominator, n).max(1) * n;
        if n == 0 || denominator > MOST_DENOMINATOR {
            return None;
        }
    }
    let mean = |unit: &Moments| unit.sum.checked_mul(denominator / i128::from(unit.n));
    Some((units.iter().map(mean).collect::<Option<_>>()?, denominator))
}

fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a } else { gcd(b, a % b) }
}

fn flips(differences: &[i128]) -> Option<Vec<(i128, f64)>> {
    let mut sums = vec![(0, 1.0)];
    for &difference in differences.iter().filter(|difference| **difference != 0) {
        let flipped = |sign: i128| sums.iter().map(move |(sum, weight)| (sum + sign * difference, weight / 2.0));
        let mut next: Vec<(i128, f64)> = flipped(-1).chain(flipped(1)).collect();
        // Two ascending runs, which a stable sort merges.
        next.sort_by_key(|(sum, _)| *sum);
        next.dedup_by(|(sum, weight), (kept, total)| {
            let is_same = sum == kept;
            *total += if is_same { *weight } else { 0.0 };
            is_same
        });
        sums = next;
        if sums.len() > MOST_OUTCOMES {
            return None;
        }
    }
    Some(sums)
}

/// The number of ways to get each sum of `drawn` values.
fn draws(pool: &[i128], drawn: usize) -> Option<BTreeMap<i128, f64>> {
    let mut by_count = vec![BTreeMap::new(); drawn + 1];
    by_count[0].insert(0, 1.0);
    for &value in pool {
        for count in (0..drawn).rev() {
            let more: Vec<(i128, f64)> = by_count[count].iter().map(|(sum, ways)| (sum + value, *ways)).collect();
            for (sum, ways) in more {
                *by_count[count + 1].entry(sum).or_insert(0.0) += ways;
            }
        }
        if by_count.iter().map(BTreeMap::len).sum::<usize>() > MOST_OUTCOMES {
            return None;
        }
    }
    by_count.pop()
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{Sides, difference_test, rate_test};
    use mirrorstats_exact::moments::Moments;
    use mirrorstats_exact::ratio::Ratio;

    fn unit(successes: usize, n: usize) -> Moments {
        Moments::default().with_truths(n - successes, successes).unwrap()
    }

    // scipy 1.17.1: binomtest(3, 3, 0.25).pvalue, binomtest(6, 7, 0.25).pvalue
    #[test]
    fn repeats_count_once_and_part_of_a_unit_does_not_count() {
        let quarter = Ratio::new(1, 4).unwrap();
        for (units, p) in [
            (vec![unit(3, 3); 3], 0.015625),
            (vec![unit(1, 1); 3], 0.015625),
            ([vec![unit(3, 3); 6], vec![unit(2, 3)]].concat(), 0.00134277343750),
        ] {
            let (test, _) = rate_test(&units, quarter).unwrap();
            assert!((test.p - p).abs() < 1e-12, "{units:?}: {}", test.p);
        }
        assert!((rate_test(&[unit(7, 21)], quarter).unwrap().0.p - 1.0).abs() < 1e-12);
        assert_eq!(rate_test(&[], quarter), None);
    }

    // Enumeration of the 64 signs: 2 * (1 + 6) / 64. scipy 1.17.1: binomtest(1, 6).pvalue
    #[test]
    fn six_scenes_shared_by_four_experiments_count_as_six() {
        let mut scenes = vec![(unit(4, 4), unit(0, 4)); 5];
        scenes.push((unit(0, 4), unit(4, 4)));
        let only = |shared: &[(Moments, Moments)]| Sides { shared: shared.to_vec(), ..Sides::default() };
        let test = difference_test(&only(&scenes)).unwrap();
        assert_eq!((test.p, test.least), (0.21875, 0.03125));
        let three = difference_test(&only(&scenes[..3])).unwrap();
        assert_eq!((three.p, three.least), (0.25, 0.25));
    }

    // scipy 1.17.1: permutation_test of the difference of means over independent samples, exact, two-sided.
    #[test]
    fn units_of_one_side_are_permuted() {
        let (first, second) = (vec![unit(1, 1); 5], vec![unit(0, 1); 5]);
        let apart = Sides { first, second, ..Sides::default() };
        let test = difference_test(&apart).unwrap();
        assert!((test.p - 2.0 / 252.0).abs() < 1e-12);
        assert_eq!(difference_test(&Sides { second: Vec::new(), ..apart }), None);
    }

    // 11 pairs 11:0, and 1 of 11 against 11 of 11 without a partner: 12 of 22 against 11 of 22. The score is 5.5 - 5.
    #[test]
    fn a_half_paired_design_uses_all_episodes() {
        let shared = vec![(unit(1, 1), unit(0, 1)); 11];
        let first = [vec![unit(1, 1)], vec![unit(0, 1); 10]].concat();
        let test = difference_test(&Sides { shared, first, second: vec![unit(1, 1); 11] }).unwrap();
        assert!(test.p > 0.7, "{test:?}");
    }
}
