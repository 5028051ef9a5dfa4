//! Confidence intervals of one cell: a rate from its counts, a mean from its moments.
//!
//! Rule: an interval that is not defined is `None`, never a point. Bounds of a rate stay inside [0, 1], and
//! a rate of 0 or 1 still has an interval with a width: that is what tells `0/21` from `0/2100`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::moments::Moments;
use super::quantile;
use crate::metric::catalog::StandardError;

/// Two bounds, `low <= high`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Interval {
    /// The lower bound.
    pub low: f64,
    /// The upper bound.
    pub high: f64,
}

impl Interval {
    /// Whether `value` lies between the bounds, bounds included.
    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// The score interval of a rate (Wilson 1927; Brown et al. 2001, equation 4).
///
/// The default here: its coverage stays near the nominal one at n = 21, also close to 0 and 1.
/// Exactly 0 is the lower bound of no success, exactly 1 the upper bound of no failure.
/// `None` for n = 0, for more successes than n, and for a confidence outside (0, 1).
#[expect(clippy::cast_precision_loss, reason = "counts of episodes are far below 2^53")]
pub fn wilson(successes: u64, n: u64, confidence: f64) -> Option<Interval> {
    let failures = counted(successes, n)?;
    let z = quantile::normal(quantile::tail(confidence)?);
    let (k, rest, n) = (successes as f64, failures as f64, n as f64);
    let spread = z * (z * z + 4.0 * k * rest / n).sqrt();
    let width = 2.0 * (n + z * z);
    let low = if successes == 0 { 0.0 } else { ((2.0 * k + z * z - spread) / width).max(0.0) };
    let high = if failures == 0 { 1.0 } else { ((2.0 * k + z * z + spread) / width).min(1.0) };
    Some(Interval { low, high })
}

/// Student's interval of a mean: mean plus and minus t(n - 1) standard errors (Student 1908).
///
/// `form` is the standard error that the metric's definition asks for. `None` for n < 2, where no
/// spread can be estimated in either form, and for a confidence outside (0, 1).
#[expect(clippy::cast_precision_loss, reason = "counts of episodes are far below 2^53")]
pub fn student_t(moments: &Moments, form: StandardError, confidence: f64) -> Option<Interval> {
    let tail = quantile::tail(confidence)?;
    let freedom = moments.n.checked_sub(1).filter(|&freedom| freedom > 0)?;
    let (mean, se) = (moments.mean()?, moments.se(form)?);
    let reach = quantile::student(tail, freedom as f64) * se;
    Some(Interval { low: mean - reach, high: mean + reach })
}

/// The failures among `n`, where there is an episode at all and no more successes than episodes.
fn counted(successes: u64, n: u64) -> Option<u64> {
    n.checked_sub(successes).filter(|_| n > 0)
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{Interval, student_t, wilson};
    use crate::cells::moments::Moments;
    use crate::metric::catalog::StandardError::{Population, Sample};

    fn check(found: Option<Interval>, low: f64, high: f64) {
        let found = found.expect("defined");
        assert!((found.low - low).abs() < 1e-10 && (found.high - high).abs() < 1e-10, "{found:?}");
    }

    fn of(values: &[i64]) -> Moments {
        values.iter().fold(Moments::default(), |m, &v| m.with(v).unwrap())
    }

    #[test]
    fn a_rate_of_nothing_or_everything_touches_its_end_exactly_and_keeps_a_width() {
        for n in [1, 2, 21, 1000, 1 << 40] {
            let (none, all) = (wilson(0, n, 0.95).unwrap(), wilson(n, n, 0.95).unwrap());
            assert_eq!((none.low.to_bits(), all.high.to_bits()), (0.0f64.to_bits(), 1.0f64.to_bits()));
            assert!(none.high > 0.0 && all.low < 1.0);
        }
    }

    #[test]
    fn what_is_undefined_has_no_interval() {
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

    // statsmodels 0.14: proportion_confint(k, n, 0.05, "wilson")
    #[test]
    fn wilson_is_the_known_one() {
        check(wilson(5, 21, 0.95), 0.106280130226365, 0.450911736829508);
        check(wilson(0, 21, 0.95), 0.0, 0.154639018924847);
        check(wilson(21, 21, 0.95), 0.845360981075153, 1.0);
        check(wilson(1, 3, 0.95), 0.061491944720396, 0.792340399197952);
    }

    // scipy 1.18: stats.t.interval(0.95, 5, loc=mean(x), scale=sem(x, ddof))
    #[test]
    fn student_is_the_known_one() {
        let m = of(&[4, 8, 15, 16, 23, 42]);
        check(student_t(&m, Sample, 0.95), 3.8423391926607877, 32.15766080733921);
        check(student_t(&m, Population, 0.95), 5.075883023855853, 30.92411697614415);
    }
}
