//! Inference for a study in progress, which may be looked at and stopped at any time.
//!
//! Rule: everything here is valid at all numbers of episodes at once. The e-value of a true hypothesis has an
//! expectation of at most 1 at every look, so the probability that it ever reaches 1 / a is at most a (Ville 1939).
//! Fixed-n p values and intervals guarantee this for a single look only.
//!
//! The bets are mixtures over the beta distribution Beta(1/2, 1/2) of the rate (Robbins 1970; Krichevsky and Trofimov
//! 1981; as bets: Waudby-Smith and Ramdas 2024, JRSS B 86:1). Such a mixture depends only on the counts: a sequence
//! needs an order, but the result does not, so no order of seeds and runs is chosen. The assumption is that each
//! episode succeeds with the same probability, whatever came before.

use super::chance::Odds;
use super::comparisons::holm;
use super::comparisons::paired::Pairs;
use super::intervals::interval::Interval;
use super::intervals::quantile;
use mirrorstats_exact::ratio::Ratio;

/// The evidence against a hypothesis, at any time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EValue {
    /// The e-value: what a bet of 1 against the hypothesis has become; the largest number where it is larger.
    pub e: f64,
    /// The anytime-valid p value: 1 / e, at most 1.
    pub p: f64,
}

/// The e-value of `successes` in `n` trials against the rate `level`, two-sided. `None` for n = 0, for more successes
/// than trials, and for a level outside [0, 1]. The cost grows with `n`.
pub fn against_level(successes: u64, n: u64, level: Ratio) -> Option<EValue> {
    let failures = n.checked_sub(successes).filter(|_| n > 0)?;
    let Odds { hit, miss } = Odds::of(level)?;
    if (hit == 0 && successes > 0) || (miss == 0 && failures > 0) {
        return Some(EValue { e: f64::MAX, p: 0.0 });
    }
    Some(mixture(successes, failures, [(hit, hit + miss), (miss, hit + miss)]).evidence())
}

/// The e-value against no difference between two paired rates: a discordant pair favours either side with probability
/// 1/2. The bet is only on discordant pairs; without any it is still 1. `None` without pairs.
pub fn discordant(pairs: Pairs) -> Option<EValue> {
    match (pairs.n(), pairs.discordant()) {
        (0, _) => None,
        (_, 0) => Some(EValue { e: 1.0, p: 1.0 }),
        (_, discordant) => against_level(pairs.first_only, discordant, Ratio::new(1, 2)?),
    }
}

/// The confidence sequence of a rate: the levels whose e-value is below 1 / (1 - confidence). It contains the rate at
/// all numbers of trials at once with a probability of at least `confidence`. `None` for n = 0, for more successes than
/// trials, and for a confidence outside (0, 1).
pub fn confidence_sequence(successes: u64, n: u64, confidence: f64) -> Option<Interval> {
    let failures = n.checked_sub(successes).filter(|_| n > 0)?;
    let least = holm::level(confidence)?.ln() + mixture(successes, failures, [(1, 1); 2]).ln();
    Some(Interval {
        low: lower(successes, failures, least),
        high: quantile::settled(1.0 - lower(failures, successes, least)),
    })
}

/// The probability of one sequence of these counts under the mixture, divided by that under the given rates of success
/// and failure. A rate must not be 0 if its count is positive. Krichevsky and Trofimov's estimator, trial by trial:
/// after i successes in t trials, the next one succeeds with probability (i + 1/2) / (t + 1). Plain arithmetic gives
/// the same bits on every machine.
fn mixture(successes: u64, failures: u64, [success, failure]: [(u64, u64); 2]) -> Scaled {
    let step = |(above, below): (u64, u64), seen: u64, trials: u64| {
        ((2 * seen + 1) as f64 * below as f64) / (2.0 * (trials + 1) as f64 * above as f64)
    };
    let won = (0..successes).fold(Scaled::ONE, |product, i| product.times(step(success, i, i)));
    (0..failures).fold(won, |product, j| product.times(step(failure, j, successes + j)))
}

/// The rate below the observed one at which the log-likelihood has fallen to `least`; 0 without successes.
fn lower(successes: u64, failures: u64, least: f64) -> f64 {
    if successes == 0 {
        return 0.0;
    }
    let (hits, misses) = (successes as f64, failures as f64);
    let likelihood = |rate: f64| hits * rate.ln() + misses * (-rate).ln_1p();
    let (mut low, mut high) = (0.0, hits / (hits + misses));
    loop {
        let middle = f64::midpoint(low, high);
        // There is no number between two neighbouring floats.
        if middle <= low || middle >= high {
            return quantile::settled(low);
        }
        if likelihood(middle) < least { low = middle } else { high = middle }
    }
}

/// A positive number `value * 2^exponent`, of any size.
#[derive(Clone, Copy)]
struct Scaled {
    value: f64,
    exponent: i32,
}

impl Scaled {
    const ONE: Self = Self { value: 1.0, exponent: 0 };

    /// The range around 1 that a value may leave before its exponent is adjusted.
    const STEP: i32 = 256;

    fn times(self, factor: f64) -> Self {
        let (value, step) = (self.value * factor, 2f64.powi(Self::STEP));
        if value > step {
            Self { value: value / step, exponent: self.exponent.saturating_add(Self::STEP) }
        } else if value * step < 1.0 {
            Self { value: value * step, exponent: self.exponent.saturating_sub(Self::STEP) }
        } else {
            Self { value, exponent: self.exponent }
        }
    }

    fn ln(self) -> f64 {
        self.value.ln() + f64::from(self.exponent) * std::f64::consts::LN_2
    }

    fn evidence(self) -> EValue {
        let e = number(self.value, self.exponent);
        let p = number(self.value.recip(), self.exponent.saturating_neg());
        EValue { e, p: p.min(1.0) }
    }
}

/// `value * 2^exponent`, at most the largest number.
fn number(value: f64, exponent: i32) -> f64 {
    // In two steps: a single power may overflow where the product does not.
    let exponent = exponent.clamp(-2048, 2048);
    let half = exponent / 2;
    (value * 2f64.powi(half) * 2f64.powi(exponent - half)).min(f64::MAX)
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use proptest::prelude::*;

    use super::{EValue, against_level, confidence_sequence, discordant};
    use crate::comparisons::paired::Pairs;
    use crate::intervals::random::SplitMix64;
    use mirrorstats_exact::ratio::Ratio;

    fn level(above: i64, below: i64) -> Ratio {
        Ratio::new(above, below).unwrap()
    }

    // Python fractions: the product of Krichevsky and Trofimov's estimates over p**k * (1 - p)**(n - k). scipy 1.17.1,
    // exp(betaln(k + 0.5, n - k + 0.5) - betaln(0.5, 0.5)) over the same, agrees in its digits.
    #[test]
    fn e_values_match_known_values() {
        for (k, n, (a, b), e, p) in [
            (0, 1, (1, 2), 1.0, 1.0),
            (6, 6, (1, 2), 14.4375, 0.06926406926406926),
            (7, 7, (1, 2), 26.8125, 0.037296037296037296),
            (8, 9, (1, 2), 5.5859375, 0.17902097902097902),
            (10, 20, (1, 2), 0.17619705200195312, 1.0),
            (13, 21, (1, 3), 6.1113961330979905, 0.16362873199860467),
            (0, 21, (1, 3), 610.4456654725178, 0.001638147433196935),
            (3, 21, (1, 10), 0.20673141417561683, 1.0),
            (260, 700, (1, 3), 0.28479275900181455, 1.0),
            (600, 1000, (1, 2), 14014283.453506406, 7.13557709402401e-08),
        ] {
            let found = against_level(k, n, level(a, b)).unwrap();
            assert!((found.e / e - 1.0).abs() < 1e-12, "{k}/{n} against {a}/{b}: {found:?}, expected {e}");
            assert!((found.p / p - 1.0).abs() < 1e-12, "{k}/{n} against {a}/{b}: {found:?}, expected {p}");
        }
    }

    // scipy 1.17.1: the roots of k log(p) + (n - k) log(1 - p) = log(1 - confidence) + betaln(...) as above, by brentq.
    #[test]
    fn confidence_sequences_match_known_values() {
        for (k, n, confidence, low, high) in [
            (0, 1, 0.95, 0.0, 0.975),
            (1, 1, 0.95, 0.025, 1.0),
            (0, 21, 0.95, 0.0, 0.21547860943015906),
            (5, 21, 0.95, 0.04454841422037854, 0.5689754125116643),
            (15, 21, 0.95, 0.3820506331855469, 0.9338439758216487),
            (21, 21, 0.95, 0.7845213905698409, 1.0),
            (15, 21, 0.8, 0.43403331538190065, 0.9114290329783211),
            (300, 1000, 0.95, 0.24898338854944796, 0.3545623473822944),
            (99_990, 100_000, 0.99, 0.9996767984129006, 0.9999852100652954),
        ] {
            let found = confidence_sequence(k, n, confidence).unwrap();
            assert!((found.low - low).abs() < 1e-10 && (found.high - high).abs() < 1e-10, "{k}/{n}: {found:?}");
        }
    }

    #[test]
    fn only_discordant_pairs_count() {
        let pairs = |both, first_only, second_only, neither| Pairs { both, first_only, second_only, neither };
        assert_eq!(discordant(pairs(30, 7, 0, 50)), against_level(7, 7, level(1, 2)));
        assert_eq!(discordant(pairs(3, 0, 0, 5)), Some(EValue { e: 1.0, p: 1.0 }));
        assert_eq!(discordant(Pairs::default()), None);
    }

    #[test]
    fn an_impossible_test_has_no_e_value_and_nothing_overflows() {
        for (k, n, (a, b)) in [(0, 0, (1, 3)), (2, 1, (1, 3)), (1, 2, (4, 3)), (1, 2, (-1, 3))] {
            assert_eq!(against_level(k, n, level(a, b)), None);
        }
        for confidence in [0.0, 1.0, f64::NAN] {
            assert_eq!(confidence_sequence(1, 2, confidence), None);
        }
        assert_eq!((confidence_sequence(0, 0, 0.95), confidence_sequence(3, 2, 0.95)), (None, None));
        let certain = Some(EValue { e: f64::MAX, p: 0.0 });
        assert_eq!((against_level(1, 2, level(0, 1)), against_level(1, 2, level(1, 1))), (certain, certain));
        assert_eq!(against_level(0, 1, level(0, 1)), Some(EValue { e: 0.5, p: 1.0 }));
        let many = against_level(5000, 5000, level(1, 10)).unwrap();
        assert_eq!((many.e.to_bits(), many.p.to_bits()), (f64::MAX.to_bits(), 0.0f64.to_bits()));
        assert!(against_level(2500, 5000, level(1, 2)).unwrap().e > 0.0);
        // 2^-900 of a fair coin: representable, though intermediate factors leave the range.
        let e = against_level(900, 900, level(1, 2)).unwrap().e;
        assert!(e > 1e268 && e < 1e271, "{e}");
    }

    /// The share of studies of fair episodes that ever reach evidence at `alpha`, with a look after each episode.
    fn ever_rejected((above, below): (i64, i64), alpha: f64) -> f64 {
        let chance = level(above, below);
        let mut random = SplitMix64::seeded(20_260_101);
        let mut study = || {
            let mut successes = 0;
            (1..=120).any(|n| {
                successes += u64::from(random.unit() < chance.value());
                against_level(successes, n, chance).is_some_and(|found| found.p <= alpha)
            })
        };
        f64::from((0..1500).map(|_| u32::from(study())).sum::<u32>()) / 1500.0
    }

    // Exact binomial tests with the same looks reject in about a quarter of such studies (`benches/COVERAGE.md`).
    #[test]
    fn stopping_at_the_first_success_keeps_the_level() {
        for rate in [(1, 2), (1, 3), (1, 10)] {
            let found = ever_rejected(rate, 0.05);
            assert!((0.002..=0.05).contains(&found), "{rate:?}: {found}");
        }
    }

    proptest! {
        #[test]
        fn the_sequence_contains_exactly_the_levels_not_refuted(n in 1u64..200, part in 0.0f64..=1.0, above in 1i64..100) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "a part of n")]
            let k = (part * n as f64) as u64;
            let (bounds, at) = (confidence_sequence(k, n, 0.95).unwrap(), level(above, 100));
            let p = against_level(k, n, at).unwrap().p;
            prop_assume!((p - 0.05).abs() > 1e-9);
            prop_assert_eq!(bounds.contains(at.value()), p > 0.05);
            prop_assert!(bounds.low < bounds.high);
            let mirrored = confidence_sequence(n - k, n, 0.95).unwrap();
            prop_assert!((bounds.low - (1.0 - mirrored.high)).abs() < 1e-10);
            let failures = against_level(n - k, n, level(100 - above, 100)).unwrap();
            // Subnormal numbers do not have nine digits.
            prop_assert!((failures.p - p).abs() <= 1e-9 * p + f64::MIN_POSITIVE);
        }
    }
}
