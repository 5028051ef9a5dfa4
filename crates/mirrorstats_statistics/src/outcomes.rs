//! Exact two-sided tests over all possible counts.
//!
//! Rule: two-sided by probability. The p value sums all counts that are at most as probable as the observed one
//! (Gibbons and Pratt 1975, the minimum likelihood rule). Weights are relative to the most probable count and follow
//! from the ratios of neighbours: without factorials or logarithms, and with the same bits on every machine.

use std::iter::successors;

pub(super) const TIE: f64 = 1e-12;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactTest {
    /// The exact p value: under the hypothesis it is at most any level with at most that probability.
    /// One below the smallest normal floating-point number is 0.
    pub p: f64,
    /// The mid-p value (Lancaster 1961): outcomes exactly as probable as the one seen count half. Less conservative,
    /// and **not guaranteed to keep the level**. 1 where only one outcome is possible.
    pub mid_p: f64,
}

/// Neighbouring counts with weights in proportion to their probabilities.
#[derive(Clone, Debug)]
pub(super) struct Outcomes {
    first: u64,
    weights: Vec<f64>,
    whole: bool,
}

impl Outcomes {
    /// The counts from `low` to `high`; `rise(j)` is the probability of `j + 1` divided by that of `j`. `mode` is the
    /// most probable count or close to it, within the bounds.
    pub fn around(mode: u64, (low, high): (u64, u64), rise: impl Fn(u64) -> f64) -> Self {
        // A product of subnormal numbers may stop shrinking.
        let is_normal = |(_, weight): &(u64, f64)| *weight >= f64::MIN_POSITIVE;
        let down = successors(Some((mode, 1.0)), |&(j, weight)| (j > low).then(|| (j - 1, weight / rise(j - 1))));
        let up = successors(Some((mode, 1.0)), |&(j, weight)| (j < high).then(|| (j + 1, weight * rise(j))));
        let mut kept: Vec<(u64, f64)> = down.take_while(is_normal).collect();
        kept.reverse();
        kept.extend(up.skip(1).take_while(is_normal));
        let (first, last) = (kept.first().map_or(mode, |(j, _)| *j), kept.last().map_or(mode, |(j, _)| *j));
        let weights = kept.into_iter().map(|(_, weight)| weight).collect();
        Self { first, weights, whole: first == low && last == high }
    }

    /// Both p values of the observed count, which must be possible.
    pub fn test(&self, seen: u64) -> ExactTest {
        if self.weights.len() == 1 && seen == self.first {
            return ExactTest { p: 1.0, mid_p: 1.0 };
        }
        let index = seen.checked_sub(self.first).and_then(|index| usize::try_from(index).ok());
        let seen = index.and_then(|index| self.weights.get(index)).copied().unwrap_or(0.0);
        let (lower, upper) = (seen * (1.0 - TIE), seen * (1.0 + TIE));
        let sum = |bound: f64| self.weights.iter().filter(|&&weight| weight <= bound).sum::<f64>();
        let (as_extreme, total) = (sum(upper), self.weights.iter().sum::<f64>());
        let tied = self.weights.iter().filter(|&&weight| lower <= weight && weight <= upper).sum::<f64>();
        ExactTest { p: as_extreme / total, mid_p: (as_extreme - tied / 2.0) / total }
    }

    /// The least p value of any count; 0 if it underflows.
    pub fn least_p(&self) -> f64 {
        let last = self.first + self.weights.len() as u64 - 1;
        if self.whole { self.test(self.first).p.min(self.test(last).p) } else { 0.0 }
    }

    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// The probability of each count from 0 to `last`; 0 if it underflows.
    pub fn probabilities(&self, last: u64) -> Vec<f64> {
        let total: f64 = self.weights.iter().sum();
        let mut all = vec![0.0; size(last + 1)];
        all[size(self.first)..].iter_mut().zip(&self.weights).for_each(|(all, weight)| *all = weight / total);
        all
    }

    /// The sum of two independent counts.
    pub(crate) fn plus(&self, other: &Self) -> Self {
        let mut weights = convolved(&self.weights, &other.weights);
        let largest = weights.iter().copied().fold(0.0, f64::max);
        for weight in &mut weights {
            *weight /= largest;
        }
        Self { first: self.first + other.first, weights, whole: self.whole && other.whole }
    }
}

/// The probabilities, or weights, of each sum of two independent counts.
pub(super) fn convolved(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut sums = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        sums[i..].iter_mut().zip(b).for_each(|(sum, y)| *sum += x * y);
    }
    sums
}

pub(super) fn size(count: u64) -> usize {
    usize::try_from(count).expect("counts of episodes are far below the address space")
}

#[cfg(test)]
mod tests {
    use super::Outcomes;

    fn coins(n: u32) -> Outcomes {
        Outcomes::around(u64::from(n) / 2, (0, n.into()), |j| {
            let j = u32::try_from(j).unwrap();
            f64::from(n - j) / f64::from(j + 1)
        })
    }

    // By hand: four coins weigh 1, 4, 6, 4, 1 of 16.
    #[test]
    fn equally_probable_counts_go_together() {
        let found = coins(4);
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-15, "{found}, {expected}");
        near(found.test(0).p, 2.0 / 16.0);
        near(found.test(0).mid_p, 1.0 / 16.0);
        near(found.test(3).p, 10.0 / 16.0);
        near(found.test(3).mid_p, 6.0 / 16.0);
        near(found.test(2).mid_p, 13.0 / 16.0);
        near(found.least_p(), 2.0 / 16.0);
    }

    #[test]
    fn sums_of_independent_counts_are_counts_of_the_whole() {
        let (sum, whole) = (coins(7).plus(&coins(5)), coins(12));
        assert!((0..=12).all(|seen| (sum.test(seen).p - whole.test(seen).p).abs() < 1e-14));
    }

    #[test]
    fn ends_that_underflow_are_left_out() {
        let many = coins(1_000_000);
        assert!(many.len() < 50_000);
        assert_eq!((many.test(0).p, many.least_p()), (0.0, 0.0));
    }
}
