//! The probabilities of all counts, by ratios of neighbours starting from the most probable count.
//!
//! Rule: only additions, products and quotients, so all machines get the same bits. Underflow gives 0.

/// The probability of each number of successes in `n` trials with this rate.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of episodes")]
pub(crate) fn probabilities(n: u64, rate: f64) -> Vec<f64> {
    let rate = rate.clamp(0.0, 1.0);
    let mode = (((n + 1) as f64 * rate) as u64).min(n);
    let odds = rate / (1.0 - rate);
    // P(k + 1) / P(k) = (n - k) / (k + 1) * odds; if success is certain, only n is possible.
    from_mode(n, mode, |k| if rate < 1.0 { (n - k) as f64 / (k + 1) as f64 * odds } else { 0.0 })
}

/// The counts whose probabilities add up to 1 at printed precision.
pub(super) fn likely(probabilities: &[f64]) -> std::ops::RangeInclusive<u64> {
    const NEGLIGIBLE: f64 = 1e-18;
    let is_likely = |probability: &f64| *probability > NEGLIGIBLE;
    let first = probabilities.iter().position(is_likely).unwrap_or(0);
    let last = probabilities.iter().rposition(is_likely).unwrap_or(0);
    first as u64..=last as u64
}

/// The probabilities of 0 to `last`, from the ratio of each to the previous: `ratio(k)` = P(k + 1) / P(k).
pub(super) fn from_mode(last: u64, mode: u64, ratio: impl Fn(u64) -> f64) -> Vec<f64> {
    let length = usize::try_from(last + 1).expect("counts of episodes are far below the address space");
    let at = usize::try_from(mode).expect("no more than the last");
    let mut weights = vec![0.0; length];
    weights[at] = 1.0;
    for (k, up) in (mode..last).zip(at..) {
        weights[up + 1] = weights[up] * ratio(k);
    }
    for down in (0..at).rev() {
        let step = ratio(down as u64);
        weights[down] = if step > 0.0 { weights[down + 1] / step } else { 0.0 };
    }
    let total: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / total).collect()
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
