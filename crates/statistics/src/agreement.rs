//! The agreement of two coders: Cohen's kappa (Cohen 1960) and its interval (Fleiss, Cohen and Everitt 1969).

use schemars::JsonSchema;
use serde::Serialize;

use crate::interval::Interval;
use crate::quantile;

/// With fewer episodes the interval of kappa does not keep its level.
pub const FEWEST: u64 = 10;

/// The episodes that two coders coded, by who of them puts a label.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct PairCounts {
    /// Both put it.
    pub both: u64,
    /// Only the first puts it.
    pub first_only: u64,
    /// Only the second puts it.
    pub second_only: u64,
    /// Neither puts it.
    pub neither: u64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kappa {
    pub value: f64,
    /// `None` if the coders never differ: the formula then gives no width.
    pub interval: Option<Interval>,
}

impl PairCounts {
    pub fn add(&mut self, first: bool, second: bool) {
        let count = match (first, second) {
            (true, true) => &mut self.both,
            (true, false) => &mut self.first_only,
            (false, true) => &mut self.second_only,
            (false, false) => &mut self.neither,
        };
        *count += 1;
    }

    pub const fn n(&self) -> u64 {
        self.both + self.first_only + self.second_only + self.neither
    }

    pub const fn agreed(&self) -> u64 {
        self.both + self.neither
    }

    /// Kappa with an interval at this confidence. `None` for fewer than [`FEWEST`] episodes, and if both coders give
    /// every episode the same label, so that all agreement is by chance.
    pub fn kappa(&self, confidence: f64) -> Option<Kappa> {
        let n = self.n() as f64;
        let counts = [[self.both, self.first_only], [self.second_only, self.neither]];
        let shares = counts.map(|row| row.map(|count| count as f64 / n));
        let rows = shares.map(|row| row[0] + row[1]);
        let columns = [0, 1].map(|at| shares[0][at] + shares[1][at]);
        let (agreed, by_chance) = (shares[0][0] + shares[1][1], rows[0] * columns[0] + rows[1] * columns[1]);
        let is_constant = self.both == self.n() || self.neither == self.n();
        if self.n() < FEWEST || is_constant {
            return None;
        }
        let value = (agreed - by_chance) / (1.0 - by_chance);
        if self.agreed() == self.n() {
            return Some(Kappa { value: 1.0, interval: None });
        }
        let rest = 1.0 - value;
        let mut spread = -(value - by_chance * rest).powi(2);
        for (i, row) in shares.iter().enumerate() {
            for (j, share) in row.iter().enumerate() {
                let weight = if i == j { 1.0 - (rows[i] + columns[i]) * rest } else { (columns[i] + rows[j]) * rest };
                spread += share * weight.powi(2);
            }
        }
        let se = (spread.max(0.0) / n).sqrt() / (1.0 - by_chance);
        let reach = quantile::normal(quantile::tail(confidence)?) * se;
        let interval = Interval { low: value - reach, high: value + reach }.within(-1.0, 1.0);
        Some(Kappa { value, interval: Some(interval) })
    }
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use proptest::prelude::*;

    use super::{Kappa, PairCounts};

    fn counts([both, first_only, second_only, neither]: [u64; 4]) -> PairCounts {
        PairCounts { both, first_only, second_only, neither }
    }

    /// `sklearn.metrics.cohen_kappa_score` 1.9.1; `cohens_kappa` of `statsmodels.stats.inter_rater` 0.15.0, `kappa_low` and
    /// `kappa_upp`.
    #[test]
    fn kappa_and_its_interval_equal_those_of_sklearn_and_statsmodels() {
        for (of, kappa, low, high) in [
            ([20, 5, 10, 15], 0.4, 0.151092290476661, 0.6489077095233389),
            ([9, 3, 2, 16], 0.647887323943662, 0.367921013506124, 0.9278536343812003),
            ([1, 0, 9, 30], 0.1428571428571429, -0.11106731510527787, 0.39678160081956415),
            ([2, 6, 5, 2], -0.4601769911504425, -0.9096820699516114, -0.010671912349273449),
            ([45, 15, 25, 15], 0.13043478260869568, -0.06293827779258965, 0.3238078430099807),
        ] {
            let Kappa { value, interval } = counts(of).kappa(0.95).unwrap();
            let interval = interval.unwrap();
            for (found, expected) in [(value, kappa), (interval.low, low), (interval.high, high)] {
                assert!((found - expected).abs() < 1e-12, "{of:?}: {found} {expected}");
            }
        }
    }

    #[test]
    fn too_few_episodes_and_constant_coders_have_no_kappa() {
        assert_eq!(counts([4, 1, 0, 4]).kappa(0.95), None, "nine episodes");
        assert!(counts([5, 1, 0, 4]).kappa(0.95).is_some());
        assert_eq!(counts([0, 0, 0, 30]).kappa(0.95), None, "the label was never put");
        assert_eq!(counts([30, 0, 0, 0]).kappa(0.95), None);
        assert_eq!(counts([5, 0, 0, 25]).kappa(0.95), Some(Kappa { value: 1.0, interval: None }));
        assert!(counts([0, 0, 5, 25]).kappa(0.95).unwrap().value.abs() < 1e-12, "one coder never puts it");
    }

    proptest! {
        #[test]
        fn swapping_coders_or_labels_keeps_kappa(of in [0_u64..60, 0..60, 0..60, 0..60]) {
            let [both, first, second, neither] = of;
            let close = |a: Option<Kappa>, b: Option<Kappa>| match (a, b) {
                (Some(a), Some(b)) => {
                    let low = |kappa: Kappa| kappa.interval.map_or(0.0, |interval| interval.low);
                    (a.value - b.value).abs() < 1e-9 && (low(a) - low(b)).abs() < 1e-9
                }
                (a, b) => a == b,
            };
            let own = counts(of).kappa(0.95);
            prop_assert!(close(own, counts([both, second, first, neither]).kappa(0.95)));
            prop_assert!(close(own, counts([neither, second, first, both]).kappa(0.95)));
            prop_assert!(own.is_none_or(|kappa| kappa.value <= 1.0 && kappa.interval.is_none_or(|i| i.contains(kappa.value))));
        }
    }
}
