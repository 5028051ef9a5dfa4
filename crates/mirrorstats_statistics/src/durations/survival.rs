//! Durations, including some with only a lower bound: unfinished episodes are censored, not slow.
//!
//! Rule: an episode without a decision is censored at its length. A decision in step t comes before censoring in t.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::intervals::interval::{Interval, student_t_of};
use crate::intervals::quantile;

/// The tolerance around one half, for rounding only.
const HALF: f64 = 0.5 + 1e-12;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ending {
    /// The steps until the decision, or until the recording stopped.
    pub steps: i64,
    pub outcome: Outcome,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// A correct decision, the awaited event.
    Correct,
    /// A wrong decision, after which a correct one can no longer come.
    Wrong,
    /// No decision: censored.
    Unfinished,
}

/// The episodes at one step in which some ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub steps: i64,
    /// The episodes that lasted until this step.
    pub at_risk: u64,
    pub decided: u64,
    /// The episodes that ended in this step, by [`Outcome`].
    pub(crate) ended: [u64; 3],
    pub(crate) before: f64,
    pub undecided: f64,
}

/// The steps in which an episode ended, ascending; `None` without episodes. A decision in a step comes before censoring
/// in that step.
pub(crate) fn points(endings: &[Ending]) -> Option<Vec<Point>> {
    let mut ends: BTreeMap<i64, [u64; 3]> = BTreeMap::new();
    for ending in endings {
        ends.entry(ending.steps).or_default()[ending.outcome as usize] += 1;
    }
    let (mut at_risk, mut before) = (endings.len() as u64, 1.0);
    let of_step = |(steps, ended): (i64, [u64; 3])| {
        let decided = ended[Outcome::Correct as usize] + ended[Outcome::Wrong as usize];
        let undecided = before * ((at_risk - decided) as f64 / at_risk as f64);
        let point = Point { steps, at_risk, decided, ended, before, undecided };
        at_risk -= ended.iter().sum::<u64>();
        before = undecided;
        point
    };
    (!ends.is_empty()).then(|| ends.into_iter().map(of_step).collect())
}

/// The last step at which a curve is known; `None` if all are decided, so that it is known forever.
pub(crate) fn known_until(points: &[Point]) -> Option<i64> {
    points.last().filter(|last| last.at_risk > last.decided).map(|last| last.steps)
}

/// Returns true if a restricted mean up to the horizon is defined.
pub(crate) fn is_known(points: &[Point], horizon: i64) -> bool {
    horizon > 0 && known_until(points).is_none_or(|known| known >= horizon)
}

/// A Kaplan-Meier curve (Kaplan and Meier 1958): the share of episodes undecided after each step.
#[derive(Clone, Debug, PartialEq)]
pub struct Survival {
    pub points: Vec<Point>,
}

/// The mean duration up to a horizon.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RestrictedMean {
    /// The horizon tau in steps: later than that counts as tau.
    pub horizon: i64,
    /// The area under the curve up to the horizon.
    pub mean: f64,
    /// Its standard error: Greenwood's times sqrt(n / (n - 1)), so that of complete durations it is that of their mean.
    pub se: f64,
    /// On the scale log(m / (tau - m)), plus and minus t(n - 1) standard errors by the delta method, so that the bounds lie
    /// inside (0, tau) and lean away from the nearer end; none for one episode, and where the standard error is zero, which
    /// says nothing about the mean of other episodes.
    pub interval: Option<Interval>,
}

/// The interval of a median.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct MedianInterval {
    /// The first step that it may be.
    pub low: i64,
    /// The last step that it may be; none if the episodes set no upper bound.
    pub high: Option<i64>,
}

impl RestrictedMean {
    /// The estimate from `n` episodes, with its interval; `variance` divides by n. `None` for confidence outside (0,
    /// 1).
    pub(crate) fn of(horizon: i64, mean: f64, variance: f64, n: u64, confidence: f64) -> Option<Self> {
        quantile::tail(confidence)?;
        let se = (variance * small_sample(n)).sqrt();
        let whole = horizon as f64;
        let is_inside = has_spread(se, horizon) && 0.0 < mean && mean < whole;
        let (center, scale) = ((mean / (whole - mean)).ln(), whole / (mean * (whole - mean)));
        let interval = student_t_of(center, scale * se, n as f64 - 1.0, confidence).filter(|_| is_inside);
        let back = |x: f64| quantile::settled(whole / (1.0 + (-x).exp()));
        let interval = interval.map(|found| Interval { low: back(found.low), high: back(found.high) });
        Some(Self { horizon, mean, se, interval })
    }
}

pub(crate) fn small_sample(n: u64) -> f64 {
    if n > 1 { n as f64 / (n - 1) as f64 } else { 1.0 }
}

/// Returns true if a standard error exceeds the rounding of steps up to `horizon`.
pub(crate) fn has_spread(se: f64, horizon: i64) -> bool {
    se > 1e-12 * horizon as f64
}

impl Survival {
    /// The curve of these episodes, with any decision as the event; `None` without any. It is the share that the
    /// Aalen-Johansen curves of both decisions leave undecided.
    pub fn of(endings: &[Ending]) -> Option<Self> {
        Some(Self { points: points(endings)? })
    }

    /// The first step by which at least half are decided; `None` if the curve stays above one half.
    pub fn median(&self) -> Option<i64> {
        self.points.iter().find(|point| point.undecided <= HALF).map(|point| point.steps)
    }

    /// The mean duration up to `horizon` (Irwin 1949; Royston and Parmar 2013), its variance by Greenwood's formula
    /// (Klein and Moeschberger 2003, equation 4.5.2). `None` for a horizon not positive or beyond the known part of the
    /// curve, and for a confidence outside (0, 1).
    pub fn restricted_mean(&self, horizon: i64, confidence: f64) -> Option<RestrictedMean> {
        if !is_known(&self.points, horizon) {
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
        let n = self.points.first()?.at_risk;
        RestrictedMean::of(horizon, area + later as f64, variance, n, confidence)
    }

    /// The pointwise interval of the share undecided after each step, Greenwood's after the transformation log(-log)
    /// (Borgan and Liestol 1990). Once all are decided, the share is below the last bounds by an unknown amount: 0 to 1.
    /// `None` for a confidence outside (0, 1).
    pub fn bounds(&self, confidence: f64) -> Option<Vec<Interval>> {
        let (z, mut sum) = (quantile::normal(quantile::tail(confidence)?), 0.0);
        let of_point = |point: &Point| {
            let (at_risk, decided) = (point.at_risk as f64, point.decided as f64);
            sum += decided / (at_risk * (at_risk - decided));
            if point.undecided > 0.0 { log_log(point.undecided, sum, z) } else { Interval { low: 0.0, high: 1.0 } }
        };
        Some(self.points.iter().map(of_point).collect())
    }

    /// The possible steps of the median (Brookmeyer and Crowley 1982): one half is in the pointwise interval of the
    /// curve there. `None` if not even the lower bound is observed, and for a confidence outside (0, 1).
    pub fn median_interval(&self, confidence: f64) -> Option<MedianInterval> {
        let mut low = None;
        for (point, bounds) in self.points.iter().zip(self.bounds(confidence)?) {
            low = low.or((bounds.low <= HALF).then_some(point.steps));
            if bounds.high <= HALF {
                return low.map(|low| MedianInterval { low, high: Some(point.steps) });
            }
        }
        low.map(|low| MedianInterval { low, high: None })
    }
}

/// The interval of a share above 0, from Greenwood's sum; the interval of a share of 1 is a point.
fn log_log(share: f64, sum: f64, z: f64) -> Interval {
    if share >= 1.0 {
        return Interval { low: 1.0, high: 1.0 };
    }
    let reach = z * sum.sqrt() / share.ln().abs();
    Interval { low: share.powf(reach.exp()), high: share.powf((-reach).exp()) }
}

/// The last step at which every curve is known: restricted means up to it are comparable. The longest duration of all if
/// every curve is known forever; `None` without curves.
pub fn common_horizon<'a>(curves: impl IntoIterator<Item = &'a Survival> + Clone) -> Option<i64> {
    let known = curves.clone().into_iter().filter_map(|curve| known_until(&curve.points)).min();
    known.or_else(|| curves.into_iter().filter_map(|curve| Some(curve.points.last()?.steps)).max())
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{Ending, MedianInterval, Outcome, Survival, common_horizon, known_until};

    fn curve(durations: &[i64]) -> Survival {
        let outcome = |steps: i64| if steps > 0 { Outcome::Correct } else { Outcome::Unfinished };
        let endings: Vec<_> = durations.iter().map(|&d| Ending { steps: d.abs(), outcome: outcome(d) }).collect();
        Survival::of(&endings).unwrap()
    }

    /// Remission times of 21 patients under 6-MP (Freireich et al. 1963), the textbook example.
    const REMISSIONS: [i64; 21] =
        [6, 6, 6, -6, 7, -9, 10, -10, -11, 13, 16, -17, -19, -20, 22, 23, -25, -32, -32, -34, -35];

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-10 * expected, "found {found}, expected {expected}");
    }

    // lifelines 0.30.3: KaplanMeierFitter(alpha=0.05).fit(T, E).confidence_interval_
    #[test]
    fn bounds_of_the_curve_are_those_of_greenwood_and_log_log() {
        let curve = curve(&REMISSIONS);
        let bounds = curve.bounds(0.95).unwrap();
        for (t, low, high) in [
            (6, 0.6197179552659838, 0.9515517476469969),
            (10, 0.5031995107999564, 0.8893618351692651),
            (23, 0.18805200595923233, 0.6801426284952412),
        ] {
            let at = curve.points.iter().position(|point| point.steps == t).unwrap();
            close(bounds[at].low, low);
            close(bounds[at].high, high);
        }
        assert_eq!(curve.bounds(1.0), None);
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
        assert_eq!((known_until(&curve.points), common_horizon([&curve])), (Some(35), Some(35)));
    }

    // lifelines 0.30.3: restricted_mean_survival_time(km, t=tau); standard errors by exact fractions in Python:
    // sqrt(sum(area(t, tau)**2 * F(d, n * (n - d)))), times sqrt(n / (n - 1))
    #[test]
    fn the_restricted_mean_matches_known_values() {
        for (durations, horizon, mean, se) in [
            (&REMISSIONS[..], 35, 23.287394957983192, 2.8274676233714393),
            (&REMISSIONS[..], 20, 16.116526610644257, 1.2515601960050473),
            (&[1, 2, 3, 4], 4, 2.5, 0.5590169943749475),
            (&[5, -100, -100, 12, 30, -100], 100, 57.833333333333336, 17.480809583760806),
        ] {
            let found = curve(durations).restricted_mean(horizon, 0.95).unwrap();
            assert_eq!(found.horizon, horizon);
            close(found.mean, mean);
            let n = f64::from(u32::try_from(durations.len()).unwrap());
            close(found.se, se * (n / (n - 1.0)).sqrt());
            let interval = found.interval.unwrap();
            assert!(interval.contains(found.mean) && interval.high <= 100.0);
        }
    }

    #[test]
    fn the_median_is_where_the_curve_reaches_one_half() {
        assert_eq!(curve(&[5, -100, -100, 12, 30, -100]).median(), Some(30));
        assert_eq!(curve(&[5, -100, -100]).median(), None);
        assert_eq!(curve(&[-100; 21]).median(), None);
        assert_eq!(curve(&[7]).median(), Some(7));
        assert_eq!(Survival::of(&[]), None);
    }

    // scipy 1.17.1: 35 * expit(logit(m / 35) -+ t.ppf(0.975, 20) * se * 35 / (m * (35 - m)))
    #[test]
    fn the_interval_of_the_restricted_mean_leans_away_from_the_nearer_end() {
        let interval = curve(&REMISSIONS).restricted_mean(35, 0.95).unwrap().interval.unwrap();
        close(interval.low, 16.728114945660174);
        close(interval.high, 28.418437311365157);
        assert_eq!(curve(&[12; 21]).restricted_mean(100, 0.95).unwrap().interval, None);
        assert_eq!(curve(&[-100; 21]).restricted_mean(100, 0.95).unwrap().interval, None);
    }

    // lifelines 0.30.3: median_survival_times(KaplanMeierFitter().fit(T, E).confidence_interval_). If all are decided
    // it bounds the median by the longest duration, which the method does not support: no bound here, as in R's survfit
    #[test]
    fn the_interval_of_the_median_matches_known_values() {
        let written = [5, 12, -100, 30, -100, 44, 61, -100, 8, 77, -100, 15, -100, 90, 33];
        for (durations, low, high) in [
            (&REMISSIONS[..], 13, None),
            (&written[..], 12, None),
            (&[3, 8, 8, 15, 20][..], 3, None),
            (&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, -10][..], 2, Some(9)),
        ] {
            assert_eq!(curve(durations).median_interval(0.95), Some(MedianInterval { low, high }), "{durations:?}");
        }
        assert_eq!(curve(&[-100; 21]).median_interval(0.95), None);
        assert_eq!(curve(&[5, 6]).median_interval(1.0), None);
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
