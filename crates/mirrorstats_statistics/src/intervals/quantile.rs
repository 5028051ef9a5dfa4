//! Quantiles for intervals: normal, Student's t and beta, and the tail for a confidence.
//!
//! Rule: quantiles have twelve significant digits. The last bit of logarithms and exponentials may differ between
//! mathematics libraries; these digits do not, and all later steps are plain arithmetic. So an interval has the same
//! bits everywhere.

use statrs::distribution::{Beta, ChiSquared, Continuous, ContinuousCDF, Normal, StudentsT};

/// Above this many degrees of freedom the expansion around the normal is exact to these digits.
const EXPANSION_FROM: f64 = 1000.0;

/// Half of the probability outside a two-sided interval: 0.025 for 0.95. `None` outside (0, 1).
pub fn tail(confidence: f64) -> Option<f64> {
    (confidence > 0.0 && confidence < 1.0).then(|| settled((1.0 - confidence) / 2.0))
}

/// The normal deviate with `tail` above it: 1.96 for 0.025. Expects 0 < `tail` <= 1/2, as [`tail`] gives.
pub fn normal(tail: f64) -> f64 {
    settled(-Normal::standard().inverse_cdf(tail))
}

/// The share of the normal distribution below a deviate.
pub(crate) fn normal_below(deviate: f64) -> f64 {
    settled(Normal::standard().cdf(deviate))
}

/// The share of the chi-squared distribution with 1 degree of freedom above `statistic`, which is not negative. By the
/// incomplete gamma function: the library's error function is accurate to only ten digits.
pub(crate) fn chi_squared_above(statistic: f64) -> f64 {
    settled(ChiSquared::new(1.0).expect("one degree of freedom is positive").sf(statistic))
}

/// The deviate of Student's t with `tail` above it, for `freedom` > 0 degrees of freedom. The library's inverse is
/// improved by Newton steps on its distribution function. For large `freedom` the incomplete beta function loses
/// digits, so the Cornish-Fisher expansion is used (Abramowitz and Stegun 1964, 26.7.5). Degrees of freedom may be
/// fractional, as Welch's are.
pub(crate) fn student(tail: f64, freedom: f64) -> f64 {
    if freedom >= EXPANSION_FROM {
        return settled(student_expansion(-Normal::standard().inverse_cdf(tail), freedom));
    }
    let t = StudentsT::new(0.0, 1.0, freedom).expect("degrees of freedom are positive");
    let start = t.inverse_cdf(tail);
    let refined = (0..3).fold(start, |x, _| x - (t.cdf(x) - tail) / t.pdf(x));
    settled(-refined)
}

/// The share of Student's t distribution beyond a deviate in either direction, for `freedom` > 0 degrees of freedom.
pub(crate) fn student_beyond(deviate: f64, freedom: f64) -> f64 {
    let t = StudentsT::new(0.0, 1.0, freedom).expect("degrees of freedom are positive");
    settled(2.0 * t.cdf(-deviate.abs()))
}

fn student_expansion(z: f64, freedom: f64) -> f64 {
    let s = z * z;
    let terms = [
        z * (s + 1.0) / 4.0,
        z * ((5.0 * s + 16.0) * s + 3.0) / 96.0,
        z * (((3.0 * s + 19.0) * s + 17.0) * s - 15.0) / 384.0,
        z * ((((79.0 * s + 776.0) * s + 1482.0) * s - 1920.0) * s - 945.0) / 92160.0,
    ];
    z + terms.iter().rev().fold(0.0, |sum, term| (sum + term) / freedom)
}

/// The point of the beta distribution with shapes `a` and `b` that has `tail` below it. The library's inverse is
/// improved by Newton steps on its distribution function; a step outside (0, 1) is not taken.
pub(crate) fn beta(tail: f64, a: f64, b: f64) -> f64 {
    let distribution = Beta::new(a, b).expect("shapes are positive");
    let start = distribution.inverse_cdf(tail);
    let refined = (0..3).fold(start, |x, _| {
        let next = x - (distribution.cdf(x) - tail) / distribution.pdf(x);
        if next > 0.0 && next < 1.0 { next } else { x }
    });
    settled(refined)
}

/// `x` to twelve significant digits.
pub fn settled(x: f64) -> f64 {
    format!("{x:.11e}").parse().expect("a printed number is a number")
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::{chi_squared_above, normal, student, student_beyond, tail};

    fn close(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 2e-11, "found {found}, expected {expected}");
    }

    // mpmath 1.4.1, 40 digits: sqrt(2) * erfinv(1 - 2 * tail)
    #[test]
    fn normal_quantiles_match_known_values() {
        close(normal(0.025), 1.95996398454005);
        close(normal(0.05), 1.64485362695147);
        close(normal(0.005), 2.5758293035489);
        close(normal(0.0005), 3.29052673149189);
    }

    // scipy 1.17.1 stats.t.isf, refined with mpmath: findroot of betainc(d/2, 1/2, 0, d/(d+t*t))/2 - tail
    // scipy 1.17.1: 2 * t.sf(x, freedom)
    #[test]
    fn student_tail_probabilities_match_known_values() {
        for (freedom, beyond) in [
            (1.0, [0.936548965138893, 0.2951672353008665, 0.1256659163780024]),
            (2.5, [0.9278065440624897, 0.1573914957579659, 0.02345118997086185]),
            (11.0, [0.9221435927771462, 0.07080395506803458, 0.0004025298181245196]),
            (40.3, [0.9208401468347593, 0.052271066125965986, 1.1646902904070114e-05]),
        ] {
            for (deviate, beyond) in [0.1, -2.0, 5.0].into_iter().zip(beyond) {
                close(student_beyond(deviate, freedom), beyond);
            }
        }
    }

    #[test]
    fn student_quantiles_match_known_values() {
        for (freedom, at_025, at_005) in [
            (1.0, 12.7062047361747, 63.6567411628716),
            (2.0, 4.30265272974946, 9.92484320091829),
            (3.0, 3.18244630528371, 5.84090930973336),
            (20.0, 2.08596344726586, 2.84533970978611),
            (20.5, 2.08270665062608, 2.83816385385564),
            (999.0, 1.96234146113345, 2.58075963726764),
            (1000.0, 1.96233908082641, 2.58075469806595),
            (5000.0, 1.96043855170651, 2.57681296655628),
        ] {
            close(student(0.025, freedom), at_025);
            close(student(0.005, freedom), at_005);
        }
    }

    // scipy 1.17.1: stats.chi2.sf(x, 1)
    #[test]
    fn chi_squared_tail_probabilities_match_known_values() {
        for (statistic, share) in [
            (0.5, 0.47950012218695337),
            (3.841458820694124, 0.04999999999999989),
            (30.0, 4.3204630578274955e-08),
            (100.0, 1.5239706048320995e-23),
        ] {
            close(chi_squared_above(statistic), share);
        }
        assert_eq!(chi_squared_above(0.0).to_bits(), 1.0f64.to_bits());
    }

    #[test]
    fn a_tail_is_half_of_one_minus_the_confidence() {
        assert_eq!(tail(0.95), Some(0.025));
        assert_eq!([tail(0.0), tail(1.0), tail(1.5), tail(f64::NAN)], [None; 4]);
    }
}
