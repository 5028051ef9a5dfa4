//! The tests of one family together: Holm's adjustment, simultaneous intervals, equivalence, and what they could show.

use crate::statistics::comparisons::compare::{Comparison, Equivalence};
use crate::statistics::comparisons::losses::{LossCase, settle};
use crate::statistics::comparisons::matching::{Units, too_few};
use mirrorstats_statistics::comparisons::holm::{holm, is_significant, level};
use mirrorstats_statistics::comparisons::margin::Spread;
use mirrorstats_statistics::intervals::interval::Interval;

impl Comparison {
    /// The smallest true difference that the test would have shown with a probability of 0.8 at this level.
    fn detectable(&self, confidence: f64, level: f64) -> Option<f64> {
        if !self.counts.is_empty() {
            return self.counts.detectable(level);
        }
        Some(Spread::of_interval(0.0, self.interval?, confidence, 1).detectable(level))
    }

    /// The interval of a quantity that bounds its loss, or its gain, at the level `share`. Of a permuted interval only both
    /// tails together keep their level.
    pub(crate) fn within(&self, share: f64, again: impl Fn(f64) -> Self) -> Option<Interval> {
        again(1.0 - if self.p_error.is_some() { share } else { 2.0 * share }).interval
    }

    /// Returns true if there are too few units even for equivalence, which no single outcome decides.
    pub(crate) fn is_few(&self, confidence: f64) -> bool {
        let counted = |units: &Units| usize::try_from(units.n).unwrap_or(usize::MAX);
        let unsaid = Self { losses: None, ..self.clone() }.unsaid(confidence);
        unsaid.is_some_and(|units| too_few(counted(&units), 0.0, confidence))
    }
}

/// The smallest true difference that each of these tests would have shown with a probability of 0.8, at the level of the
/// first step of Holm's procedure; of all that show none. The test with the largest variance decides.
pub(crate) fn reach(family: &[&Comparison], confidence: f64) -> Option<f64> {
    let tests = family.iter().filter(|it| it.p.is_some()).count();
    let level = level(confidence)? / tests.max(1) as f64;
    let silent = family.iter().filter(|it| it.p.is_some() && !it.separated && it.unsaid(confidence).is_none());
    let wide = |it: &Comparison| {
        let spread = it.counts.spread().map(|spread| spread.detectable(level));
        spread.or_else(|| it.detectable(confidence, level)).unwrap_or_default()
    };
    silent.max_by(|a, b| wide(a).total_cmp(&wide(b)))?.detectable(confidence, level)
}

/// Adjusts the tests of a family by Holm's method. `again` compares the same blocks at another confidence.
pub(crate) fn adjust<'c>(
    family: impl Iterator<Item = (&'c mut Comparison, impl Fn(f64) -> Comparison)>,
    margin: Option<f64>,
    confidence: f64,
) {
    let mut tested: Vec<_> = family.filter(|(comparison, _)| comparison.p.is_some()).collect();
    let seen = |it: &Comparison| LossCase { difference: it.difference, p: it.p };
    let settled = settle(tested.iter_mut().map(|(it, _)| (seen(it), &mut it.losses)), confidence);
    let share = (1.0 - confidence) / tested.len().max(1) as f64;
    for ((comparison, again), (p, is_shown)) in tested.iter_mut().zip(settled) {
        comparison.p_adjusted = Some(p);
        comparison.separated = is_shown && !comparison.units.as_ref().is_some_and(|units| units.too_few);
        comparison.simultaneous = match comparison.interval {
            None => None,
            Some(_) if comparison.counts.is_empty() => again(1.0 - share).interval,
            Some(_) => comparison.rate_interval(1.0 - share),
        };
    }
    let Some(margin) = margin else { return };
    let found: Vec<Option<f64>> = tested
        .iter()
        .map(|(it, again)| {
            let is_open = it.losses.is_none() && !it.is_few(confidence);
            if !it.counts.is_empty() {
                return it.counts.equivalent(margin).filter(|_| is_open);
            }
            let within = it.within(share, again).filter(|_| is_open)?;
            Some(if within.low > -margin && within.high < margin { 0.0 } else { 1.0 })
        })
        .collect();
    let mut adjusted = holm(&found.iter().flatten().copied().collect::<Vec<_>>()).into_iter();
    for ((comparison, _), _) in tested.iter_mut().zip(&found).filter(|(_, p)| p.is_some()) {
        let Some(p_adjusted) = adjusted.next() else { return };
        comparison.equivalence =
            Some(Equivalence { margin, p_adjusted, is_shown: is_significant(p_adjusted, confidence) });
    }
}
