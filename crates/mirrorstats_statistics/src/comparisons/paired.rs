//! Two rates over the same episodes: which side solved episodes that the other did not.
//!
//! Rule: only pairs with two defined values count. Agreement carries no information about a difference; the test uses
//! only discordant pairs, the interval uses all pairs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::chance;
use crate::intervals::interval::{Interval, wilson};
use crate::outcomes::ExactTest;
use mirrorstats_exact::ratio::Ratio;

/// The 2x2 table of paired outcomes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Pairs {
    /// Both are 1.
    pub both: u64,
    /// Only the first is 1.
    pub first_only: u64,
    /// Only the second is 1.
    pub second_only: u64,
    /// Both are 0.
    pub neither: u64,
}

impl Pairs {
    /// The table of these pairs of values; 1 is a success, any other value a failure.
    pub fn of(values: impl IntoIterator<Item = (i64, i64)>) -> Self {
        let mut pairs = Self::default();
        for value in values {
            match value {
                (1, 1) => pairs.both += 1,
                (1, _) => pairs.first_only += 1,
                (_, 1) => pairs.second_only += 1,
                _ => pairs.neither += 1,
            }
        }
        pairs
    }

    pub fn n(self) -> u64 {
        self.both + self.first_only + self.second_only + self.neither
    }

    /// The first rate minus the second; `None` without pairs.
    pub fn difference(self) -> Option<f64> {
        (self.n() > 0).then(|| (self.first_only as f64 - self.second_only as f64) / self.n() as f64)
    }

    /// The exact two-sided test of no difference (`McNemar` 1947; as a sign test: Dixon and Mood 1946). Without a
    /// difference, a discordant pair favours either side with probability 1/2. 1 if no pair is discordant; `None`
    /// without pairs.
    pub fn mcnemar(self) -> Option<f64> {
        self.test().map(|test| test.p)
    }

    /// [`Pairs::mcnemar`] and its mid-p value (Fagerland, Lydersen and Laake 2013, BMC Med. Res. Methodol. 13:91).
    pub fn test(self) -> Option<ExactTest> {
        match (self.n(), self.discordant()) {
            (0, _) => None,
            (_, 0) => Some(ExactTest { p: 1.0, mid_p: 1.0 }),
            (_, discordant) => chance::exact_test(self.first_only, discordant, Ratio::new(1, 2)?),
        }
    }

    pub(crate) fn discordant(self) -> u64 {
        self.first_only + self.second_only
    }

    /// The interval of [`Pairs::difference`]: square and add, with the correlation of the pairs (Newcombe 1998,
    /// Statistics in Medicine 17:2635, method 10). `None` without pairs and for a confidence outside (0, 1).
    pub fn interval(self, confidence: f64) -> Option<Interval> {
        let (n, difference) = (self.n(), self.difference()?);
        // The distances from a rate to its Wilson bounds.
        let arms = |successes: u64| {
            let rate = successes as f64 / n as f64;
            wilson(successes, n, confidence).map(|bounds| (rate - bounds.low, bounds.high - rate))
        };
        let (first, second) = (arms(self.both + self.first_only)?, arms(self.both + self.second_only)?);
        let phi = self.correlation();
        let reach = |a: f64, b: f64| (a * a - 2.0 * phi * a * b + b * b).max(0.0).sqrt();
        Some(Interval {
            low: (difference - reach(first.0, second.1)).max(-1.0),
            high: (difference + reach(first.1, second.0)).min(1.0),
        })
    }

    /// Newcombe's phi: continuity-corrected towards 0 if positive, 0 if a margin is empty.
    fn correlation(self) -> f64 {
        let [a, b, c, d] = [self.both, self.first_only, self.second_only, self.neither].map(|count| count as f64);
        let margins = (a + b) * (c + d) * (a + c) * (b + d);
        let excess = a * d - b * c;
        let corrected = if excess > 0.0 { (excess - self.n() as f64 / 2.0).max(0.0) } else { excess };
        if margins > 0.0 { corrected / margins.sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use proptest::prelude::*;

    use super::Pairs;

    fn pairs([both, first_only, second_only, neither]: [u64; 4]) -> Pairs {
        Pairs { both, first_only, second_only, neither }
    }

    // statsmodels 0.15.0: mcnemar([[0, b], [c, 0]], exact=True).pvalue
    #[test]
    fn the_exact_test_matches_known_values() {
        for (b, c, expected) in
            [(5, 0, 0.0625), (6, 0, 0.03125), (8, 1, 0.0390625), (10, 3, 0.09228515625), (4, 4, 1.0), (0, 0, 1.0)]
        {
            assert_eq!(pairs([3, b, c, 4]).mcnemar(), Some(expected), "{b}-{c}");
        }
    }

    // Python fractions over comb(n, j) / 2**n; Fagerland et al. 2013: p minus the probability of the observed counts, 1
    // minus half of it if both counts are equal.
    #[test]
    fn mid_p_matches_known_values() {
        for (b, c, mid_p) in [
            (1, 0, 0.5),
            (5, 0, 0.03125),
            (8, 1, 0.021484375),
            (10, 3, 0.057373046875),
            (4, 4, 0.86328125),
            (20, 9, 0.04277394525706768),
            (0, 0, 1.0),
        ] {
            let found = pairs([3, b, c, 4]);
            assert!((found.test().unwrap().mid_p - mid_p).abs() < 1e-15, "{b}-{c}");
        }
    }

    // Python: method 10 over the Wilson limits of statsmodels 0.15.0, proportion_confint(k, n, 0.05, "wilson")
    #[test]
    fn the_interval_matches_known_values() {
        for (table, low, high) in [
            ([36, 12, 2, 0], 0.0569295840032387, 0.340427602974941),
            ([10, 8, 1, 2], 0.0557733667386439, 0.552373622263244),
            ([54, 0, 0, 0], -0.0664135880908963, 0.0664135880908963),
            ([53, 1, 0, 0], -0.0496216618894039, 0.0977143748878192),
            ([0, 30, 0, 24], 0.407969089767531, 0.679975358277704),
            ([0, 0, 0, 21], -0.154639018924847, 0.154639018924847),
            ([5, 5, 5, 6], -0.277846012710692, 0.277846012710692),
            ([1, 9, 10, 1], -0.414259614423976, 0.333028514535466),
        ] {
            let found = pairs(table).interval(0.95).unwrap();
            assert!((found.low - low).abs() < 1e-10 && (found.high - high).abs() < 1e-10, "{table:?}: {found:?}");
        }
    }

    #[test]
    fn without_pairs_there_is_no_result() {
        let none = Pairs::default();
        assert_eq!((none.difference(), none.mcnemar(), none.interval(0.95)), (None, None, None));
        assert_eq!(none.test(), None);
    }

    proptest! {
        #[test]
        fn swapping_the_sides_negates_the_difference(table in prop::array::uniform4(0u64..40)) {
            prop_assume!(table.iter().sum::<u64>() > 0);
            let (here, there) = (pairs(table), pairs([table[0], table[2], table[1], table[3]]));
            let (a, b) = (here.interval(0.95).unwrap(), there.interval(0.95).unwrap());
            prop_assert!((a.low + b.high).abs() < 1e-12 && (a.high + b.low).abs() < 1e-12);
            prop_assert_eq!(here.mcnemar(), there.mcnemar());
            prop_assert!(a.contains(here.difference().unwrap()));
            prop_assert!((0.0..=1.0).contains(&here.mcnemar().unwrap()));
        }
    }
}
