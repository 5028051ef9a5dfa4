//! How much two restricted means differ, episodes being independent or paired.
//!
//! Rule: both sides up to the same horizon. The variance of a side is that of the infinitesimal jackknife; a pair's
//! two episodes vary together, so of pairs it is the differences that are squared. Variances divide by n - 1.

use super::competing::{Ending, Incidence, Influence};
use super::interval::Interval;
use super::quantile;
use super::survival::{has_spread, small_sample};

/// One restricted mean minus another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The horizon of both, in steps.
    pub horizon: i64,
    /// The first minus the second, in steps.
    pub difference: f64,
    /// Its standard error.
    pub se: f64,
    /// Plus and minus normal deviates, within the horizon; `None` where the standard error is zero.
    pub interval: Option<Interval>,
    /// Two-sided, by the normal distribution; `None` where the standard error is zero.
    pub p: Option<f64>,
}

/// The difference between two independent sets of episodes (Royston and Parmar 2013).
///
/// `None` where either curve is not known up to the horizon, and for a confidence outside (0, 1).
pub fn independent(first: &[Ending], second: &[Ending], horizon: i64, confidence: f64) -> Option<Difference> {
    let means = Means::of(first.iter().copied(), second.iter().copied(), horizon, confidence)?;
    let squares = |influence: &Influence, endings: &[Ending]| -> f64 {
        let sum: f64 = endings.iter().map(|&ending| influence.of(ending)).map(|x| x * x).sum();
        sum * small_sample(endings.len() as u64)
    };
    let variance = squares(&means.influences[0], first) + squares(&means.influences[1], second);
    means.difference(variance, confidence)
}

/// The difference between the two sides of pairs.
///
/// With complete durations this is the mean of the differences and its sample standard error.
/// `None` as in [`independent`].
pub fn paired(pairs: &[(Ending, Ending)], horizon: i64, confidence: f64) -> Option<Difference> {
    let (first, second) = (pairs.iter().map(|pair| pair.0), pairs.iter().map(|pair| pair.1));
    let means = Means::of(first, second, horizon, confidence)?;
    let [a, b] = &means.influences;
    let variance: f64 = pairs.iter().map(|&(first, second)| a.of(first) - b.of(second)).map(|x| x * x).sum();
    means.difference(variance * small_sample(pairs.len() as u64), confidence)
}

/// The last step that both sides are known to; the longest episode where both are known for ever.
pub fn shared_horizon(first: &[Ending], second: &[Ending]) -> Option<i64> {
    let known = [first, second].into_iter().filter_map(|side| Incidence::of(side)?.known_until()).min();
    known.or_else(|| first.iter().chain(second).map(|ending| ending.steps).max())
}

/// The two sides of a difference.
struct Means {
    horizon: i64,
    difference: f64,
    influences: [Influence; 2],
}

impl Means {
    fn of(
        first: impl Iterator<Item = Ending>,
        second: impl Iterator<Item = Ending>,
        horizon: i64,
        confidence: f64,
    ) -> Option<Self> {
        let (a, b) = (Incidence::of(&first.collect::<Vec<_>>())?, Incidence::of(&second.collect::<Vec<_>>())?);
        let mean = |curve: &Incidence| curve.restricted_mean(horizon, confidence).map(|found| found.mean);
        let difference = mean(&a)? - mean(&b)?;
        Some(Self { horizon, difference, influences: [a.influence(horizon), b.influence(horizon)] })
    }

    #[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
    fn difference(self, variance: f64, confidence: f64) -> Option<Difference> {
        let z = quantile::normal(quantile::tail(confidence)?);
        let (difference, se, most) = (self.difference, variance.sqrt(), self.horizon as f64);
        let has_spread = has_spread(se, self.horizon);
        let interval = Interval { low: difference - z * se, high: difference + z * se }.within(-most, most);
        Some(Difference {
            horizon: self.horizon,
            difference,
            se,
            interval: has_spread.then_some(interval),
            p: has_spread.then(|| 2.0 * quantile::normal_below(-(difference / se).abs())),
        })
    }
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{independent, paired, shared_horizon};
    use crate::stats::competing::tests::{FIRST, close, endings};

    const SECOND: &str = "9c 40c 100- 52w 100- 70c 61c 100- 3w 100- 100- 25c 64c 99c 12w";

    // Python, exact fractions: derivatives of both means by the episodes' weights, squared and summed per side or per
    // pair, times n / (n - 1); scipy 1.17.1: norm.ppf(0.975), norm.sf
    #[test]
    fn differences_are_the_known_ones() {
        let (first, second) = (endings(FIRST), endings(SECOND));
        let pairs: Vec<_> = first.iter().copied().zip(second.iter().copied()).collect();
        for (horizon, difference, [se, low, high, p], [pair_se, pair_low, pair_high, pair_p]) in [
            (
                80,
                -3.6666666666666665,
                [9.407663205287857, -22.105347727713514, 14.77201439438018, 0.6967190668241203],
                [8.365841355614005, -20.06341442404586, 12.730081090712526, 0.6611758956724791],
            ),
            (
                60,
                -3.8666666666666667,
                [6.561745799443007, -16.727452109281945, 8.99411877594861, 0.5556774349962038],
                [5.232559845781273, -14.12229551134842, 6.3889621780150865, 0.45992963389587327],
            ),
        ] {
            let apart = independent(&first, &second, horizon, 0.95).unwrap();
            let together = paired(&pairs, horizon, 0.95).unwrap();
            for (found, [se, low, high, p]) in
                [(apart, [se, low, high, p]), (together, [pair_se, pair_low, pair_high, pair_p])]
            {
                close(found.difference, difference);
                close(found.se, se);
                close(found.interval.unwrap().low, low);
                close(found.interval.unwrap().high, high);
                close(found.p.unwrap(), p);
            }
        }
    }

    /// scipy 1.17.1: sem(x - y) of complete durations
    #[test]
    fn complete_pairs_have_the_standard_error_of_their_differences() {
        let (first, second) = (endings("3c 8c 15c 20c 44c"), endings("5c 4c 10c 31c 39c"));
        let pairs: Vec<_> = first.into_iter().zip(second).collect();
        let found = paired(&pairs, 44, 0.95).unwrap();
        close(found.difference, 0.2);
        close(found.se, 3.0886890422961);
    }

    #[test]
    fn no_spread_has_no_interval_and_an_unknown_horizon_no_difference() {
        let (all, none) = (endings("12c 12c 12c"), endings("100- 100-"));
        let found = independent(&all, &none, 100, 0.95).unwrap();
        close(found.difference, -88.0);
        assert_eq!((found.interval, found.p), (None, None));
        assert_eq!(independent(&all, &none, 101, 0.95), None);
        assert_eq!(independent(&all, &[], 10, 0.95), None);
        assert_eq!((shared_horizon(&all, &none), shared_horizon(&all, &all)), (Some(100), Some(12)));
    }
}
