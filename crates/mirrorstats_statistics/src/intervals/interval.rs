//! Confidence intervals of one cell: a rate from its counts, a mean from its moments.
//!
//! Rule: an undefined interval is `None`. Bounds of a rate stay inside [0, 1], and the interval of a rate of 0 or 1
//! still has a width, which distinguishes `0/21` from `0/2100`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::intervals::quantile;
use mirrorstats_exact::moments::{Moments, StandardError};

/// Two bounds, `low <= high`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Interval {
    /// The lower bound.
    pub low: f64,
    /// The upper bound.
    pub high: f64,
}

impl Interval {
    pub const UNBOUNDED: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// The part between `least` and `most`; bounds beyond them are meaningless.
    #[must_use]
    pub fn within(self, least: f64, most: f64) -> Self {
        Self { low: self.low.clamp(least, most), high: self.high.clamp(least, most) }
    }

    /// The bounds of the negated value.
    #[must_use]
    pub fn negated(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }

    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// The score interval of a rate (Wilson 1927; Brown et al. 2001, equation 4). The default: its coverage stays near the
/// nominal one at n = 21, also close to 0 and 1. The lower bound without successes is exactly 0, the upper bound
/// without failures exactly 1. `None` for n = 0, for more successes than n, and for a confidence outside (0, 1).
pub fn wilson(successes: u64, n: u64, confidence: f64) -> Option<Interval> {
    let failures = counted(successes, n)?;
    score(successes as f64, failures as f64, n as f64, confidence)
}

/// The same over `n` units of several episodes each. A unit counts once, as the mean of its episodes; that varies at most
/// as much as one verdict per unit, so the interval is never too narrow for its mean.
pub fn wilson_of_units(mean: f64, n: usize, confidence: f64) -> Option<Interval> {
    let n = n as f64;
    if n > 0.0 { score(mean * n, (1.0 - mean) * n, n, confidence) } else { None }
}

fn score(k: f64, rest: f64, n: f64, confidence: f64) -> Option<Interval> {
    let z = quantile::normal(quantile::tail(confidence)?);
    let spread = z * (z * z + 4.0 * k * rest / n).sqrt();
    let width = 2.0 * (n + z * z);
    let low = if k == 0.0 { 0.0 } else { ((2.0 * k + z * z - spread) / width).max(0.0) };
    let high = if rest == 0.0 { 1.0 } else { ((2.0 * k + z * z + spread) / width).min(1.0) };
    Some(Interval { low, high })
}

/// The exact interval of a rate (Clopper and Pearson 1934): covers at least the nominal share, often more. Bounds are
/// quantiles of beta distributions (Brown et al. 2001, section 4.2.1). Ends and `None` as in [`wilson`].
pub fn clopper_pearson(successes: u64, n: u64, confidence: f64) -> Option<Interval> {
    equal_tails(successes, n, confidence, [(0.0, 1.0), (1.0, 0.0)])
}

/// The equal-tailed credible interval of a rate under the Jeffreys prior Beta(1/2, 1/2) (Brown et al. 2001, section
/// 3.1.3, with their ends: 0 for no success, 1 for no failure). `None` as in [`wilson`].
pub fn jeffreys(successes: u64, n: u64, confidence: f64) -> Option<Interval> {
    equal_tails(successes, n, confidence, [(0.5, 0.5), (0.5, 0.5)])
}

fn equal_tails(successes: u64, n: u64, confidence: f64, prior: [(f64, f64); 2]) -> Option<Interval> {
    let failures = counted(successes, n)?;
    let tail = quantile::tail(confidence)?;
    let (k, rest, [below, above]) = (successes as f64, failures as f64, prior);
    let low = || quantile::beta(tail, k + below.0, rest + below.1);
    let high = || quantile::settled(1.0 - quantile::beta(tail, rest + above.1, k + above.0));
    Some(Interval { low: if successes == 0 { 0.0 } else { low() }, high: if failures == 0 { 1.0 } else { high() } })
}

/// Student's interval of a mean: mean plus and minus t(n - 1) standard errors (Student 1908). `form` is the standard
/// error that the metric's definition asks for. `None` for n < 2, where neither form can estimate a spread, and for a
/// confidence outside (0, 1). The bounds coincide if all values are equal: the method has no more information.
pub fn student_t(moments: &Moments, form: StandardError, confidence: f64) -> Option<Interval> {
    let freedom = moments.n.checked_sub(1)?;
    student_t_of(moments.mean()?, moments.se(form)?, freedom as f64, confidence)
}

/// The same for any estimate with its standard error and degrees of freedom; `None` unless these are positive.
pub(crate) fn student_t_of(estimate: f64, se: f64, freedom: f64, confidence: f64) -> Option<Interval> {
    let tail = quantile::tail(confidence)?;
    let reach = (freedom > 0.0).then(|| quantile::student(tail, freedom) * se)?;
    Some(Interval { low: estimate - reach, high: estimate + reach })
}

/// The number of failures in `n`; `None` without episodes, or for more successes than episodes.
fn counted(successes: u64, n: u64) -> Option<u64> {
    n.checked_sub(successes).filter(|_| n > 0)
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use proptest::prelude::*;

    use super::{Interval, clopper_pearson, jeffreys, student_t, wilson};
    use mirrorstats_exact::moments::Moments;
    use mirrorstats_exact::moments::StandardError::{Population, Sample};

    fn check(found: Option<Interval>, low: f64, high: f64) {
        let found = found.expect("defined");
        assert!((found.low - low).abs() < 1e-10 && (found.high - high).abs() < 1e-10, "{found:?}");
    }

    fn of(values: &[i64]) -> Moments {
        values.iter().fold(Moments::default(), |m, &v| m.with(v).unwrap())
    }

    #[test]
    fn the_interval_of_an_extreme_rate_ends_at_the_rate_and_has_width() {
        for n in [1, 2, 21, 1000, 1 << 40] {
            let (none, all) = (wilson(0, n, 0.95).unwrap(), wilson(n, n, 0.95).unwrap());
            assert_eq!((none.low.to_bits(), all.high.to_bits()), (0.0f64.to_bits(), 1.0f64.to_bits()));
            assert!(none.high > 0.0 && all.low < 1.0);
        }
    }

    #[test]
    fn undefined_rates_have_no_interval() {
        assert_eq!(wilson(0, 0, 0.95), None);
        assert_eq!(wilson(3, 2, 0.95), None);
        for confidence in [0.0, 1.0, -0.5, f64::NAN] {
            assert_eq!(wilson(1, 2, confidence), None);
            assert_eq!(student_t(&of(&[1, 2]), Sample, confidence), None);
        }
        for form in [Sample, Population] {
            assert_eq!(student_t(&of(&[]), form, 0.95), None);
            assert_eq!(student_t(&of(&[7]), form, 0.95), None);
        }
    }

    // statsmodels 0.15.0: proportion_confint(k, n, 0.05, "wilson")
    #[test]
    fn wilson_matches_known_values() {
        check(wilson(5, 21, 0.95), 0.106280130226365, 0.450911736829508);
        check(wilson(0, 21, 0.95), 0.0, 0.154639018924847);
        check(wilson(21, 21, 0.95), 0.845360981075153, 1.0);
        check(wilson(1, 3, 0.95), 0.061491944720396, 0.792340399197952);
    }

    // scipy 1.17.1: stats.t.interval(0.95, 5, loc=mean(x), scale=sem(x, ddof))
    #[test]
    fn student_matches_known_values() {
        let m = of(&[4, 8, 15, 16, 23, 42]);
        check(student_t(&m, Sample, 0.95), 3.8423391926607877, 32.15766080733921);
        check(student_t(&m, Population, 0.95), 5.075883023855853, 30.92411697614415);
    }

    // statsmodels 0.15.0: proportion_confint(k, n, 0.05, "beta"), likewise "jeffreys" if 0 < k < n; at the ends
    // statsmodels' Jeffreys is one-sided, and its inner bound is the same.
    #[test]
    fn beta_intervals_match_known_values() {
        for (k, n, [cp_low, cp_high], [j_low, j_high]) in [
            (0, 21, [0.0, 0.16109761521908], [0.0, 0.111470316193041]),
            (1, 21, [0.00120488344836351, 0.238159909936821], [0.00518704310790212, 0.201755968321684]),
            (5, 21, [0.0821758755930226, 0.471659827654621], [0.0971633529367245, 0.445703406360434]),
            (20, 21, [0.761840090063179, 0.998795116551636], [0.798244031678316, 0.994812956892098]),
            (21, 21, [0.83890238478092, 1.0], [0.888529683806959, 1.0]),
            (1, 1, [0.025, 1.0], [0.146746316309575, 1.0]),
            (300, 10000, [0.0267440137894148, 0.0335333642052194], [0.026791300097862, 0.033480681840341]),
            (999, 1000, [0.994441075720173, 0.999974682512509], [0.995335541191209, 0.999892081195319]),
        ] {
            check(clopper_pearson(k, n, 0.95), cp_low, cp_high);
            check(jeffreys(k, n, 0.95), j_low, j_high);
        }
    }

    proptest! {
        #[test]
        fn intervals_hold_the_rate_and_mirror_and_nest(n in 1u64..400, part in 0.0f64..=1.0, confidence in 0.5f64..0.999) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "a part of n")]
            let k = (part * n as f64) as u64;
            #[expect(clippy::cast_precision_loss, reason = "small counts")]
            let rate = k as f64 / n as f64;
            for method in [wilson, clopper_pearson, jeffreys] {
                let (here, mirrored) = (method(k, n, confidence).unwrap(), method(n - k, n, confidence).unwrap());
                prop_assert!(0.0 <= here.low && here.low < here.high && here.high <= 1.0);
                prop_assert!(here.contains(rate), "{here:?} {rate}");
                prop_assert!((here.low - (1.0 - mirrored.high)).abs() < 1e-10);
                let wider = method(k, n, 0.9995).unwrap();
                prop_assert!(wider.low <= here.low && here.high <= wider.high);
            }
            let (exact, credible) = (clopper_pearson(k, n, confidence).unwrap(), jeffreys(k, n, confidence).unwrap());
            prop_assert!(exact.low <= credible.low && credible.high <= exact.high);
        }
    }
}
