//! A rate against a dose: does it rise or fall?
//!
//! Rule: episodes are compared only within a stratum. A scene that is played at several doses is a stratum, so unequal
//! difficulty of scenes does not confound doses; independent episodes are one stratum.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::intervals::quantile;

/// The Cochran-Armitage test of no trend, stratified: Mantel's extension of the Mantel-Haenszel test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Trend {
    /// The standard normal deviate; above 0 where the rate rises with the dose.
    pub z: f64,
    /// Its two-sided p value, by the limit of many episodes.
    pub p: f64,
    /// The strata with several doses and both outcomes: the others say nothing.
    pub strata: u64,
}

/// The test over strata of (dose, value), with the variance of permutations within each stratum (Mantel 1963). A value is
/// 0 or 1, or the mean of a stratum's repeats at a dose. `None` if no stratum has two doses and two values, and for a
/// dose that is not finite.
pub fn cochran_armitage<S: AsRef<[(f64, f64)]>>(strata: &[S]) -> Option<Trend> {
    let (mut excess, mut variance, mut informative) = (0.0, 0.0, 0);
    for stratum in strata.iter().map(AsRef::as_ref) {
        if stratum.iter().any(|(dose, _)| !dose.is_finite()) {
            return None;
        }
        let (own_excess, own_variance) = term(stratum);
        if own_variance > 0.0 {
            informative += 1;
            excess += own_excess;
            variance += own_variance;
        }
    }
    let z = excess / variance.sqrt();
    (variance > 0.0).then(|| Trend { z, p: quantile::chi_squared_above(z * z), strata: informative })
}

/// The sum of the values times their doses minus its mean over all permutations, and its variance.
fn term(stratum: &[(f64, f64)]) -> (f64, f64) {
    let n = stratum.len() as f64;
    // Means of repeats may differ by rounding from their own mean.
    if stratum.len() < 2 || stratum.iter().all(|(_, value)| value.total_cmp(&stratum[0].1).is_eq()) {
        return (0.0, 0.0);
    }
    let mean = stratum.iter().map(|(dose, _)| dose).sum::<f64>() / n;
    let rate = stratum.iter().map(|(_, value)| value).sum::<f64>() / n;
    let spread: f64 = stratum.iter().map(|(dose, _)| (dose - mean).powi(2)).sum();
    let varied: f64 = stratum.iter().map(|(_, value)| (value - rate).powi(2)).sum();
    let excess = stratum.iter().map(|(dose, value)| (dose - mean) * value).sum();
    (excess, varied / (n - 1.0) * spread)
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::cochran_armitage;

    /// Successes and episodes by dose, as one stratum.
    fn stratum(counts: &[(f64, usize, usize)]) -> Vec<(f64, f64)> {
        let each = |&(dose, successes, n): &(f64, usize, usize)| {
            (0..n).map(move |at| (dose, f64::from(u8::from(at < successes))))
        };
        counts.iter().flat_map(each).collect()
    }

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found} {expected}");
    }

    // Python: statsmodels 0.15.0, Table(..).test_ordinal_association with the doses as row scores.
    #[test]
    fn one_stratum_is_the_known_test() {
        for (counts, z, p) in [
            (
                &[
                    (0.0, 20, 21),
                    (1.0, 19, 21),
                    (2.0, 18, 21),
                    (4.0, 15, 21),
                    (8.0, 13, 21),
                    (16.0, 8, 21),
                    (32.0, 6, 21),
                ][..],
                -5.778677392851782,
                7.529013379707327e-09,
            ),
            (&[(0.0, 3, 7), (1.0, 4, 9), (8.0, 2, 5)], -0.13459547551454137, 0.8929317190719969),
        ] {
            let found = cochran_armitage(&[stratum(counts)]).unwrap();
            close(found.z, z);
            close(found.p / p, 1.0);
            assert_eq!(found.strata, 1);
        }
    }

    // Python: itertools 3.11, mean and variance over every permutation within each stratum; scipy 1.17.1 norm.sf.
    #[test]
    fn several_strata_are_permuted_each_by_itself() {
        let strata: [&[(f64, f64)]; 5] = [
            &[(0.0, 1.0), (2.0, 1.0), (8.0, 0.0)],
            &[(0.0, 1.0), (2.0, 0.0), (8.0, 0.0)],
            &[(0.0, 0.0), (2.0, 1.0), (8.0, 0.0)],
            &[(0.0, 1.0), (2.0, 1.0), (8.0, 1.0)],
            &[(0.0, 0.0), (2.0, 0.0), (8.0, 1.0), (8.0, 0.0)],
        ];
        let found = cochran_armitage(&strata).unwrap();
        close(found.z, -0.8471323832501184);
        close(found.p, 0.3969213369099841);
        assert_eq!(found.strata, 4);
    }

    #[test]
    fn without_a_comparison_there_is_no_trend() {
        assert_eq!(cochran_armitage::<Vec<(f64, f64)>>(&[]), None);
        assert_eq!(cochran_armitage(&[stratum(&[(0.0, 3, 3), (1.0, 4, 4)])]), None, "all succeed");
        assert_eq!(cochran_armitage(&[stratum(&[(2.0, 1, 4)])]), None, "one dose");
        assert_eq!(cochran_armitage(&[stratum(&[(0.0, 1, 2), (f64::NAN, 1, 2)])]), None);
    }

    #[test]
    fn a_constant_stratum_is_ignored_and_reversed_doses_negate_the_trend() {
        let one = stratum(&[(0.0, 9, 10), (4.0, 6, 10), (16.0, 2, 10)]);
        let alone = cochran_armitage(std::slice::from_ref(&one)).unwrap();
        assert_eq!(cochran_armitage(&[one.clone(), stratum(&[(0.0, 2, 2), (4.0, 2, 2)])]), Some(alone));
        let turned: Vec<_> = one.iter().map(|(dose, success)| (-dose, *success)).collect();
        close(cochran_armitage(&[turned]).unwrap().z, -alone.z);
        assert!(alone.z < 0.0);
    }
}
