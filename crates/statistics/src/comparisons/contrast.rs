//! The difference between two independent cells: one condition minus another.

use crate::interval::{Interval, student_t_of, wilson};
use exact::moments::{Moments, StandardError};

/// The interval of a difference of two independent rates, the first minus the second: square and add
/// (Newcombe 1998, Statistics in Medicine 17:873, method 10).
///
/// `None` if either rate has no interval.
pub fn newcombe(first: (u64, u64), second: (u64, u64), confidence: f64) -> Option<Interval> {
    let (a, b) = (wilson(first.0, first.1, confidence)?, wilson(second.0, second.1, confidence)?);
    let (p, q) = (first.0 as f64 / first.1 as f64, second.0 as f64 / second.1 as f64);
    let reach = |x: f64, y: f64| (x * x + y * y).sqrt();
    Some(Interval {
        low: (p - q - reach(p - a.low, b.high - q)).max(-1.0),
        high: (p - q + reach(a.high - p, q - b.low)).min(1.0),
    })
}

/// The interval of a difference of two independent means, variances unequal (Welch 1938; degrees of
/// freedom by Satterthwaite 1946).
///
/// Always from sample standard errors. `None` if either side has fewer than two values, or if neither has a spread.
pub fn welch(first: &Moments, second: &Moments, confidence: f64) -> Option<Interval> {
    let difference = first.mean()? - second.mean()?;
    let part = |moments: &Moments| moments.se(StandardError::Sample).map(|se| (se * se, (moments.n - 1) as f64));
    let (variance, freedom) = satterthwaite([part(first)?, part(second)?]);
    student_t_of(difference, variance.sqrt(), freedom, confidence)
}

/// The variance of a difference and its degrees of freedom, from the values of both sides (Satterthwaite 1946).
pub(crate) fn satterthwaite(sides: [(f64, f64); 2]) -> (f64, f64) {
    let variance: f64 = sides.iter().map(|(variance, _)| variance).sum();
    let parts: f64 = sides.iter().map(|(variance, freedom)| variance * variance / freedom).sum();
    (variance, variance * variance / parts)
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{Interval, newcombe, welch};
    use exact::moments::Moments;

    fn of(values: &[i64]) -> Moments {
        values.iter().fold(Moments::default(), |m, &v| m.with(v).unwrap())
    }

    fn check(found: Option<Interval>, low: f64, high: f64) {
        let found = found.expect("defined");
        assert!((found.low - low).abs() < 1e-10 && (found.high - high).abs() < 1e-10, "{found:?}");
    }

    // statsmodels 0.15.0: confint_proportions_2indep(k1, n1, k2, n2, method="newcomb", compare="diff").
    // The first two are Newcombe's examples (a) and (c): 0.0524 to 0.3339, 0.1705 to 0.8090.
    #[test]
    fn newcombe_matches_known_values() {
        check(newcombe((56, 70), (48, 80), 0.95), 0.052431472402365, 0.333872654036906);
        check(newcombe((9, 10), (3, 10), 0.95), 0.170522723934503, 0.809017973535488);
        check(newcombe((21, 21), (0, 21), 0.95), 0.781307402164412, 1.0);
        check(newcombe((19, 21), (7, 21), 0.95), 0.283437968804294, 0.746835882580389);
        assert_eq!(newcombe((0, 0), (1, 2), 0.95), None);
    }

    // scipy 1.17.1: ttest_ind(x, y, equal_var=False).confidence_interval()
    #[test]
    fn welch_matches_known_values() {
        check(welch(&of(&[4, 8, 15, 16, 23, 42]), &of(&[3, 5, 9, 1]), 0.95), -0.657935919364713, 27.6579359193647);
        assert_eq!(welch(&of(&[1]), &of(&[1, 2]), 0.95), None);
        assert_eq!(welch(&of(&[3, 3]), &of(&[5, 5]), 0.95), None);
        assert!(welch(&of(&[3, 3]), &of(&[5, 6]), 0.95).is_some());
    }
}
