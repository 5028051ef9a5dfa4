//! Many tests at once: p values that keep the level for the whole family.

use crate::intervals::quantile;

/// The level of a test at this confidence: 0.05 for 0.95; `None` outside (0, 1).
pub fn level(confidence: f64) -> Option<f64> {
    quantile::tail(confidence).map(|tail| 2.0 * tail)
}

/// Returns true if a p value reaches the level of this confidence.
pub fn is_significant(p: f64, confidence: f64) -> bool {
    level(confidence).is_some_and(|level| p <= level)
}

/// Holm's step-down adjustment (Holm 1979): valid under any dependence between the tests. Compare an adjusted value
/// with the level of the whole family. Values are in input order; each is at least its own p value and at most 1.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut adjusted = vec![0.0; p_values.len()];
    let mut reached = 0.0f64;
    for (rank, index) in order.into_iter().enumerate() {
        let remaining = (p_values.len() - rank) as f64;
        reached = reached.max((remaining * p_values[index]).min(1.0));
        adjusted[index] = reached;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::{holm, level};

    // statsmodels 0.15.0: multipletests(p, method="holm")[1]
    #[test]
    fn the_adjustment_matches_known_values() {
        let found = holm(&[0.01, 0.04, 0.03, 0.005, 0.2, 0.6]);
        let expected = [0.05, 0.12, 0.12, 0.03, 0.4, 0.6];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?}");
        assert!(holm(&[]).is_empty());
    }

    #[test]
    fn the_level_is_one_minus_the_confidence() {
        assert_eq!((level(0.95), level(0.99), level(1.0)), (Some(0.05), Some(0.01), None));
    }

    proptest! {
        #[test]
        fn the_adjustment_keeps_order_and_bounds(p in prop::collection::vec(0.0f64..=1.0, 1..30)) {
            let adjusted = holm(&p);
            for i in 0..p.len() {
                prop_assert!(adjusted[i] >= p[i] && adjusted[i] <= 1.0);
                for j in 0..p.len() {
                    prop_assert!(p[i] > p[j] || adjusted[i] <= adjusted[j]);
                }
            }
        }
    }
}
