//! The agreement of two coders: Cohen's kappa (Cohen 1960) and its interval (Fleiss, Cohen and Everitt 1969).

use crate::comparisons::paired::Pairs;
use crate::intervals::interval::Interval;
use crate::intervals::quantile;

/// With fewer episodes the interval of kappa does not keep its level.
pub const FEWEST: u64 = 10;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kappa {
    pub value: f64,
    /// `None` if the coders never differ: the formula then gives no width.
    pub interval: Option<Interval>,
}

impl Kappa {
    /// Kappa with an interval at this confidence; a coder's success is a label put on an episode. `None` for fewer than
    /// [`FEWEST`] episodes, and if both coders give every episode the same label, so that all agreement is by chance.
    pub fn of(pairs: Pairs, confidence: f64) -> Option<Self> {
        let n = pairs.n() as f64;
        let counts = [[pairs.both, pairs.first_only], [pairs.second_only, pairs.neither]];
        let shares = counts.map(|row| row.map(|count| count as f64 / n));
        let rows = shares.map(|row| row[0] + row[1]);
        let columns = [0, 1].map(|at| shares[0][at] + shares[1][at]);
        let (agreed, by_chance) = (shares[0][0] + shares[1][1], rows[0] * columns[0] + rows[1] * columns[1]);
        let is_constant = [pairs.both, pairs.neither].contains(&pairs.n());
        if pairs.n() < FEWEST || is_constant {
            return None;
        }
        let value = (agreed - by_chance) / (1.0 - by_chance);
        if pairs.discordant() == 0 {
            return Some(Self { value: 1.0, interval: None });
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
        Some(Self { value, interval: Some(interval) })
    }
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use proptest::prelude::*;

    use super::Kappa;
    use crate::comparisons::paired::Pairs;

    fn kappa([both, first_only, second_only, neither]: [u64; 4]) -> Option<Kappa> {
        Kappa::of(Pairs { both, first_only, second_only, neither }, 0.95)
    }

    /// `sklearn.metrics.cohen_kappa_score` 1.9.1; `cohens_kappa` of `statsmodels.stats.inter_rater` 0.15.0, `kappa_low` and
    /// `kappa_upp`.
    #[test]
    fn kappa_and_its_interval_equal_those_of_sklearn_and_statsmodels() {
        for (of, expected, low, high) in [
            ([20, 5, 10, 15], 0.4, 0.151092290476661, 0.6489077095233389),
            ([9, 3, 2, 16], 0.647887323943662, 0.367921013506124, 0.9278536343812003),
            ([1, 0, 9, 30], 0.1428571428571429, -0.11106731510527787, 0.39678160081956415),
            ([2, 6, 5, 2], -0.4601769911504425, -0.9096820699516114, -0.010671912349273449),
            ([45, 15, 25, 15], 0.13043478260869568, -0.06293827779258965, 0.3238078430099807),
        ] {
            let Kappa { value, interval } = kappa(of).unwrap();
            let interval = interval.unwrap();
            for (found, expected) in [(value, expected), (interval.low, low), (interval.high, high)] {
                assert!((found - expected).abs() < 1e-12, "{of:?}: {found} {expected}");
            }
        }
    }

    #[test]
    fn too_few_episodes_and_constant_coders_have_no_kappa() {
        assert_eq!(kappa([4, 1, 0, 4]), None, "nine episodes");
        assert!(kappa([5, 1, 0, 4]).is_some());
        assert_eq!(kappa([0, 0, 0, 30]), None, "the label was never put");
        assert_eq!(kappa([30, 0, 0, 0]), None);
        assert_eq!(kappa([5, 0, 0, 25]), Some(Kappa { value: 1.0, interval: None }));
        assert!(kappa([0, 0, 5, 25]).unwrap().value.abs() < 1e-12, "one coder never puts it");
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
            let own = kappa(of);
            prop_assert!(close(own, kappa([both, second, first, neither])));
            prop_assert!(close(own, kappa([neither, second, first, both])));
            prop_assert!(own.is_none_or(|kappa| kappa.value <= 1.0 && kappa.interval.is_none_or(|i| i.contains(kappa.value))));
        }
    }
}
