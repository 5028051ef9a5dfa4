//! Durations of which some are only known to be longer: unfinished episodes are censored, not slow.
//!
//! Rule: an episode that ends without a decision says that the decision takes more than its length.
//! A decision in step t comes before censoring in step t.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::interval::Interval;
use super::quantile;

/// How near the curve must come to one half to count as having reached it: rounding only.
const HALF: f64 = 0.5 + 1e-12;

/// How long an episode took, or at least lasted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Duration {
    /// The steps until the decision, or until the recording stopped.
    pub steps: i64,
    /// How it ended.
    pub end: End,
}

/// How an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// With a decision, at its last step counted.
    Finished,
    /// Without one: the duration is censored.
    Unfinished,
}

/// A Kaplan-Meier curve (Kaplan and Meier 1958): the share of episodes undecided after each step.
#[derive(Clone, Debug, PartialEq)]
pub struct Survival {
    /// The steps at which an episode ended, ascending.
    pub points: Vec<Point>,
}

/// One step of the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The step.
    pub steps: i64,
    /// The episodes that lasted until here.
    pub at_risk: u64,
    /// The episodes decided here.
    pub decided: u64,
    /// The share undecided after this step.
    pub undecided: f64,
}

/// The mean duration up to a horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RestrictedMean {
    /// The horizon tau in steps: later than that counts as tau.
    pub horizon: i64,
    /// The area under the curve up to the horizon.
    pub mean: f64,
    /// Its standard error.
    pub se: f64,
    /// The mean plus and minus normal deviates of these standard errors, within [0, tau].
    pub interval: Interval,
}

impl Survival {
    /// The curve of these durations; `None` without any.
    #[expect(clippy::cast_precision_loss, reason = "counts of episodes are far below 2^53")]
    pub fn of(durations: &[Duration]) -> Option<Self> {
        let mut ends: BTreeMap<i64, (u64, u64)> = BTreeMap::new();
        for duration in durations {
            let (decided, censored) = ends.entry(duration.steps).or_default();
            *if duration.end == End::Finished { decided } else { censored } += 1;
        }
        let mut at_risk = durations.len() as u64;
        let mut undecided = 1.0;
        let mut points = Vec::with_capacity(ends.len());
        for (steps, (decided, censored)) in ends {
            undecided *= (at_risk - decided) as f64 / at_risk as f64;
            points.push(Point { steps, at_risk, decided, undecided });
            at_risk -= decided + censored;
        }
        (!points.is_empty()).then_some(Self { points })
    }

    /// The first step by which at least half are decided; `None` where the curve stays above one half.
    pub fn median(&self) -> Option<i64> {
        self.points.iter().find(|point| point.undecided <= HALF).map(|point| point.steps)
    }

    /// The last step that the curve is known to, and `None` where it is known for ever: all decided.
    pub fn known_until(&self) -> Option<i64> {
        self.points.last().filter(|point| point.undecided > 0.0).map(|point| point.steps)
    }

    /// The longest duration seen, decided or not.
    pub fn longest(&self) -> Option<i64> {
        self.points.last().map(|point| point.steps)
    }

    /// The mean duration up to `horizon` (Irwin 1949; Royston and Parmar 2013), its variance by Greenwood's
    /// formula (Klein and Moeschberger 2003, equation 4.5.2).
    ///
    /// `None` for a horizon that is not positive or lies beyond what the curve is known to, and for a confidence
    /// outside (0, 1).
    #[expect(clippy::cast_precision_loss, reason = "steps and counts are far below 2^53")]
    pub fn restricted_mean(&self, horizon: i64, confidence: f64) -> Option<RestrictedMean> {
        let z = quantile::normal(quantile::tail(confidence)?);
        if horizon <= 0 || self.known_until().is_some_and(|known| known < horizon) {
            return None;
        }
        let (mut area, mut variance, mut later) = (0.0, 0.0, horizon);
        for point in self.points.iter().rev().filter(|point| point.steps < horizon) {
            area += point.undecided * (later as f64 - point.steps as f64);
            later = point.steps;
            let remaining = point.at_risk - point.decided;
            if remaining > 0 {
                variance += area * area * point.decided as f64 / (point.at_risk as f64 * remaining as f64);
            }
        }
        let (mean, se) = (area + later as f64, variance.sqrt());
        let interval = Interval { low: (mean - z * se).max(0.0), high: (mean + z * se).min(horizon as f64) };
        Some(RestrictedMean { horizon, mean, se, interval })
    }
}

/// The largest horizon that every curve is known to: restricted means up to it compare like with like.
///
/// The longest duration of all where every curve is known for ever. `None` without a curve.
pub fn common_horizon<'a>(curves: impl IntoIterator<Item = &'a Survival> + Clone) -> Option<i64> {
    let known = curves.clone().into_iter().filter_map(Survival::known_until).min();
    known.or_else(|| curves.into_iter().filter_map(Survival::longest).max())
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{Duration, End, Survival, common_horizon};

    /// Durations; a negative one is censored.
    fn curve(durations: &[i64]) -> Survival {
        let end = |steps: i64| if steps > 0 { End::Finished } else { End::Unfinished };
        let durations: Vec<_> = durations.iter().map(|&d| Duration { steps: d.abs(), end: end(d) }).collect();
        Survival::of(&durations).unwrap()
    }

    /// Remission times of 21 patients under 6-MP (Freireich et al. 1963), the textbook example.
    const REMISSIONS: [i64; 21] =
        [6, 6, 6, -6, 7, -9, 10, -10, -11, 13, 16, -17, -19, -20, 22, 23, -25, -32, -32, -34, -35];

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-10 * expected, "found {found}, expected {expected}");
    }

    // lifelines 0.30.3: KaplanMeierFitter().fit(T, E).survival_function_, median_survival_time_
    #[test]
    fn the_curve_is_the_textbook_one() {
        let curve = curve(&REMISSIONS);
        let at = |t: i64| curve.points.iter().find(|point| point.steps == t).unwrap();
        close(at(6).undecided, 0.857142857142857);
        close(at(10).undecided, 0.7529411764705878);
        close(at(23).undecided, 0.44817927170868327);
        assert_eq!((at(10).at_risk, at(10).decided), (15, 1));
        assert_eq!(curve.median(), Some(23));
        assert_eq!((curve.known_until(), curve.longest()), (Some(35), Some(35)));
    }

    // lifelines 0.30.3: restricted_mean_survival_time(km, t=tau); standard errors by exact fractions in Python:
    // sqrt(sum(area(t, tau)**2 * F(d, n * (n - d))))
    #[test]
    fn the_restricted_mean_is_the_known_one() {
        for (durations, horizon, mean, se) in [
            (&REMISSIONS[..], 35, 23.287394957983192, 2.8274676233714393),
            (&REMISSIONS[..], 20, 16.116526610644257, 1.2515601960050473),
            (&[1, 2, 3, 4], 4, 2.5, 0.5590169943749475),
            (&[5, -100, -100, 12, 30, -100], 100, 57.833333333333336, 17.480809583760806),
        ] {
            let found = curve(durations).restricted_mean(horizon, 0.95).unwrap();
            assert_eq!(found.horizon, horizon);
            close(found.mean, mean);
            close(found.se, se);
            assert!(found.interval.contains(found.mean) && found.interval.high <= 100.0);
        }
    }

    #[test]
    fn half_reached_exactly_is_the_median_and_half_not_reached_is_none() {
        assert_eq!(curve(&[5, -100, -100, 12, 30, -100]).median(), Some(30));
        assert_eq!(curve(&[5, -100, -100]).median(), None);
        assert_eq!(curve(&[-100; 21]).median(), None);
        assert_eq!(curve(&[7]).median(), Some(7));
        assert_eq!(Survival::of(&[]), None);
    }

    #[test]
    fn nothing_is_claimed_beyond_the_last_unfinished_episode() {
        let cut = curve(&[5, 60, -40, -80]);
        assert!(cut.restricted_mean(80, 0.95).is_some());
        assert_eq!(cut.restricted_mean(81, 0.95), None);
        let decided = curve(&[5, 60, -40]);
        close(decided.restricted_mean(1000, 0.95).unwrap().mean, decided.restricted_mean(60, 0.95).unwrap().mean);
        assert_eq!(common_horizon([&cut, &decided]), Some(80));
        assert_eq!(common_horizon([&decided]), Some(60));
        assert_eq!(common_horizon([]), None);
    }

    #[test]
    fn without_censoring_the_restricted_mean_is_the_mean() {
        let durations = [3, 8, 8, 15, 20];
        close(curve(&durations).restricted_mean(20, 0.95).unwrap().mean, 54.0 / 5.0);
    }
}
