//! Time to a correct decision. A wrong decision ends the wait for good, so it is a competing event and not censoring.
//!
//! Rule: an episode without a decision is censored at its length. A decision in step t comes before censoring in step
//! t. If every decision counts as correct, this is the Kaplan-Meier curve.

use std::collections::BTreeMap;

pub use crate::durations::survival::{Ending, Outcome};
use crate::durations::survival::{Point, RestrictedMean, is_known, points};

/// The tolerance around one half, for rounding only.
const HALF: f64 = 0.5 - 1e-12;

/// The Aalen-Johansen curve (Aalen and Johansen 1978): the share of episodes decided correctly by each step.
#[derive(Clone, Debug, PartialEq)]
pub struct Incidence {
    points: Vec<Point>,
}

/// The contribution of each kind of episode to a restricted mean: the derivative by the episode's weight. The sum of
/// squares over the episodes is the variance by the infinitesimal jackknife (Jaeckel 1972; Efron 1982, chapter 6); for
/// a single cause it is Greenwood's.
#[derive(Clone, Debug)]
pub(crate) struct Influence {
    points: BTreeMap<i64, [f64; 3]>,
}

impl Incidence {
    /// The curve of these episodes; `None` without any.
    pub fn of(endings: &[Ending]) -> Option<Self> {
        Some(Self { points: points(endings)? })
    }

    /// Each step, and the shares decided correctly and wrongly by its end.
    fn curve(&self) -> impl Iterator<Item = (i64, [f64; 2])> {
        self.points.iter().scan([0.0; 2], |sums, point| {
            let [correct, wrong, _] = point.counts();
            let more = [correct, wrong].map(|ended| point.before * ended / point.at_risk as f64);
            *sums = [sums[0] + more[0], sums[1] + more[1]];
            // The sums carry the rounding of every step, and may exceed 1; the decided share is exact at 0 and 1.
            let (decided, sum) = (1.0 - point.undecided, sums[0] + sums[1]);
            let correct = if sum > 0.0 { decided * (sums[0] / sum) } else { 0.0 };
            Some((point.steps, [correct, decided - correct]))
        })
    }

    /// The shares decided correctly and wrongly by the end of a step; the remainder is undecided.
    pub fn shares(&self, steps: i64) -> [f64; 2] {
        self.curve().take_while(|(at, _)| *at <= steps).last().map_or([0.0; 2], |(_, shares)| shares)
    }

    /// The first step by which at least half of all episodes are decided correctly; `None` if that never happens.
    pub fn median(&self) -> Option<i64> {
        self.curve().find(|(_, [correct, _])| *correct >= HALF).map(|(steps, _)| steps)
    }

    /// The mean number of steps to a correct decision; later than `horizon` and never both count as `horizon`. It
    /// equals the horizon minus the area under the curve (Andersen 2013). Its standard error is the infinitesimal
    /// jackknife's times sqrt(n / (n - 1)). `None` for a horizon not positive or beyond the known part of the curve,
    /// and for a confidence outside (0, 1).
    pub fn restricted_mean(&self, horizon: i64, confidence: f64) -> Option<RestrictedMean> {
        if !is_known(&self.points, horizon) {
            return None;
        }
        let variance = self.variance(&self.influence(horizon));
        RestrictedMean::of(horizon, self.mean(horizon), variance, self.n(), confidence)
    }

    pub fn n(&self) -> u64 {
        self.points[0].at_risk
    }

    fn mean(&self, horizon: i64) -> f64 {
        let early = self.points.iter().take_while(|point| point.steps < horizon);
        let area: f64 = early.map(|point| point.gain(horizon) * point.counts()[0] / point.at_risk as f64).sum();
        horizon as f64 - area
    }

    fn variance(&self, influence: &Influence) -> f64 {
        let of_point = |point: &Point| {
            let [taken, correct, wrong] = influence.points[&point.steps];
            let squares = [correct - taken, wrong - taken, taken].map(|x| x * x);
            let [correct, wrong, censored] = point.counts();
            correct * squares[0] + wrong * squares[1] + censored * squares[2]
        };
        self.points.iter().map(of_point).sum()
    }

    /// The contributions of the curve's episodes to the restricted mean.
    pub(crate) fn influence(&self, horizon: i64) -> Influence {
        // The reduction of all later gains by a larger share of decisions at a step.
        let mut later = 0.0;
        let mut slopes = Vec::with_capacity(self.points.len());
        for point in self.points.iter().rev() {
            let gain = if point.steps < horizon { point.gain(horizon) } else { 0.0 };
            let left = 1.0 - point.decided as f64 / point.at_risk as f64;
            let lost = if left > 0.0 { later / left } else { 0.0 };
            slopes.push([lost - gain, lost]);
            later += gain * point.counts()[0] / point.at_risk as f64;
        }
        let mut taken = 0.0;
        let mut points = BTreeMap::new();
        for (point, slopes) in self.points.iter().zip(slopes.into_iter().rev()) {
            let at_risk = point.at_risk as f64;
            let [correct, wrong] = slopes.map(|slope| slope / at_risk);
            let [are_correct, are_wrong, _] = point.counts();
            taken += (correct * are_correct + wrong * are_wrong) / at_risk;
            points.insert(point.steps, [taken, correct, wrong]);
        }
        Influence { points }
    }
}

impl Point {
    fn counts(&self) -> [f64; 3] {
        self.ended.map(|count| count as f64)
    }

    fn gain(&self, horizon: i64) -> f64 {
        self.before * (horizon - self.steps) as f64
    }
}

impl Influence {
    /// The contribution of one episode; panics if it is not part of the curve.
    pub(crate) fn of(&self, ending: Ending) -> f64 {
        let [taken, correct, wrong] = self.points[&ending.steps];
        match ending.outcome {
            Outcome::Correct => correct - taken,
            Outcome::Wrong => wrong - taken,
            Outcome::Unfinished => -taken,
        }
    }
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
pub(super) mod tests {
    use super::{Ending, Incidence, Outcome};
    use crate::durations::survival::{Survival, known_until};

    /// Endings: the steps, and `c` for correct, `w` for wrong, `-` for unfinished.
    pub(crate) fn endings(written: &str) -> Vec<Ending> {
        let outcome = |kind: &str| match kind {
            "c" => Outcome::Correct,
            "w" => Outcome::Wrong,
            _ => Outcome::Unfinished,
        };
        let ending = |word: &str| {
            let (steps, kind) = word.split_at(word.len() - 1);
            Ending { steps: steps.parse().unwrap(), outcome: outcome(kind) }
        };
        written.split_whitespace().map(ending).collect()
    }

    pub(crate) const FIRST: &str = "5c 12w 100- 30c 100- 44w 61c 80- 8c 77c 100- 15w 100- 90c 33c";

    pub(crate) fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "found {found}, expected {expected}");
    }

    // statsmodels 0.15.0: CumIncidenceRight(time, status).cinc
    #[test]
    fn the_curve_matches_known_values() {
        let curve = Incidence::of(&endings(FIRST)).unwrap();
        for (steps, correct, wrong) in [
            (4, 0.0, 0.0),
            (5, 0.06666666666666667, 0.0),
            (15, 0.13333333333333333, 0.13333333333333333),
            (61, 0.33333333333333337, 0.2),
            (89, 0.4, 0.2),
            (90, 0.48000000000000004, 0.2),
            (1000, 0.48000000000000004, 0.2),
        ] {
            let [found_correct, found_wrong] = curve.shares(steps);
            close(found_correct, correct);
            close(found_wrong, wrong);
        }
        assert_eq!((curve.median(), known_until(&curve.points), curve.n()), (None, Some(100), 15));
        assert_eq!(Incidence::of(&endings("7c 9c 11w 100-")).unwrap().median(), Some(9));
    }

    // Python, exact fractions: the mean as a function of the episodes' weights, differentiated by each weight with a
    // step of 1e-12, squared and summed; times sqrt(n / (n - 1)). scipy 1.17.1 for the bounds: logit, expit, t.ppf.
    #[test]
    fn the_restricted_mean_matches_known_values() {
        let curve = Incidence::of(&endings(FIRST)).unwrap();
        let factor = (15.0f64 / 14.0).sqrt();
        for (horizon, mean, se) in
            [(80, 62.266666666666666, 7.0461757423862625), (60, 49.06666666666667, 4.97323205139646)]
        {
            let found = curve.restricted_mean(horizon, 0.95).unwrap();
            close(found.mean, mean);
            close(found.se, se * factor);
        }
        let interval = curve.restricted_mean(80, 0.95).unwrap().interval.unwrap();
        close(interval.low, 42.449578820355754);
        close(interval.high, 73.28078969128643);
        assert_eq!(curve.restricted_mean(101, 0.95), None);
        assert_eq!(curve.restricted_mean(0, 0.95), None);
    }

    #[test]
    fn without_wrong_decisions_it_is_the_kaplan_meier_curve() {
        let steps = [6, 6, 6, -6, 7, -9, 10, -10, -11, 13, 16, -17, -19, -20, 22, 23, -25, -32, -32, -34, -35i64];
        let ending =
            |&d: &i64| Ending { steps: d.abs(), outcome: if d > 0 { Outcome::Correct } else { Outcome::Unfinished } };
        let endings: Vec<Ending> = steps.iter().map(ending).collect();
        let (curve, survival) = (Incidence::of(&endings).unwrap(), Survival::of(&endings).unwrap());
        for horizon in [5, 6, 20, 35] {
            let (a, b) =
                (curve.restricted_mean(horizon, 0.95).unwrap(), survival.restricted_mean(horizon, 0.95).unwrap());
            close(a.mean, b.mean);
            close(a.se, b.se);
        }
    }

    #[test]
    fn a_wrong_decision_never_becomes_correct_later() {
        let found = Incidence::of(&endings("10w 10w 10w")).unwrap().restricted_mean(100, 0.95).unwrap();
        assert_eq!((found.mean, found.interval), (100.0, None));
        let censored = Incidence::of(&endings("10- 20c 20c")).unwrap();
        close(censored.restricted_mean(100, 0.95).unwrap().mean, 20.0);
    }
}
