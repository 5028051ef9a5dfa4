//! The probabilities of all counts, by ratios of neighbours starting from the most probable count.
//!
//! Rule: only additions, products and quotients, so all machines get the same bits. Underflow gives 0.

use crate::outcomes::Outcomes;

/// The probability of each number of successes in `n` trials with this rate.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of episodes")]
pub(crate) fn probabilities(n: u64, rate: f64) -> Vec<f64> {
    let rate = rate.clamp(0.0, 1.0);
    let mode = (((n + 1) as f64 * rate) as u64).min(n);
    let odds = rate / (1.0 - rate);
    // If success is certain, only n is possible.
    let fewest = if rate < 1.0 { 0 } else { n };
    Outcomes::around(mode, (fewest, n), |k| (n - k) as f64 / (k + 1) as f64 * odds).probabilities(n)
}

/// The counts whose probabilities add up to 1 at printed precision.
pub(super) fn likely(probabilities: &[f64]) -> std::ops::RangeInclusive<u64> {
    const NEGLIGIBLE: f64 = 1e-18;
    let is_likely = |probability: &f64| *probability > NEGLIGIBLE;
    let first = probabilities.iter().position(is_likely).unwrap_or(0);
    let last = probabilities.iter().rposition(is_likely).unwrap_or(0);
    first as u64..=last as u64
}

#[cfg(test)]
mod tests {
    use super::probabilities;

    // scipy 1.17.1: binom.pmf(k, n, p)
    #[test]
    #[expect(clippy::unreadable_literal, reason = "reference values as their source prints them")]
    fn probabilities_match_known_values() {
        for (n, rate, k, expected) in [
            (21, 0.3, 6, 0.18780620309837354),
            (500, 0.013, 6, 0.15839599380117572),
            (1000, 0.65, 700, 9.872401283836229e-5),
        ] {
            let found = probabilities(n, rate)[k];
            assert!((found - expected).abs() < 1e-12, "{n} {rate} {k}: {found}");
        }
    }

    #[test]
    fn certainty_leaves_one_count() {
        assert_eq!(probabilities(3, 0.0), [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(probabilities(3, 1.0), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(probabilities(0, 0.4), [1.0]);
    }
}
