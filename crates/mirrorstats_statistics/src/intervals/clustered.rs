//! The unit of replication: if episodes of one cluster share something, clusters are independent and episodes are not.
//!
//! Rule: the design declares clusters; nothing here guesses them. A statement about new clusters rests on the number of
//! clusters. Sums stay integers up to one division.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::intervals::interval::{Interval, student_t_of};
use crate::intervals::quantile;
use mirrorstats_exact::moments::Moments;

/// The fewest clusters with which a test can reach a level. Reversing the signs of C cluster means gives 2^C equally
/// likely outcomes under no effect, hence no two-sided p below 2^(1-C): 0.0625 for five clusters, 0.031 for six.
/// Cluster-robust inference is known to fail well above that number too (Cameron and Miller 2015, section VI).
pub fn fewest_clusters(level: f64) -> usize {
    let reach = |clusters: &usize| 0.5f64.powi(i32::try_from(*clusters).unwrap_or(i32::MAX) - 1) <= level;
    // For smaller levels the power underflows, and no number of clusters reaches them.
    (1..1100).find(reach).unwrap_or(usize::MAX)
}

/// The mean of a cell as its clusters estimate it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Clustered {
    /// The number of clusters with a value, C.
    pub clusters: usize,
    /// The cluster-robust standard error of the mean (Liang and Zeger 1986), times sqrt(C / (C - 1)):
    /// for clusters of equal size, the standard error of the cluster means.
    pub se: f64,
    /// The mean plus and minus t(C - 1) of these standard errors (Cameron and Miller 2015, section VI); of a rate on the
    /// scale of log odds, by the delta method. `None` where the standard error is zero: clusters that happen to be alike
    /// say nothing about others.
    pub interval: Option<Interval>,
    /// The intraclass correlation by analysis of variance (Donner 1986), negative where clusters
    /// are more alike than their members; `None` where no value differs or every cluster has one value.
    pub icc: Option<f64>,
    /// 1 + (m - 1) icc with m = sum of squared sizes / n, the size of a member's cluster (Kish 1965):
    /// by how much clustering multiplies the variance of the mean. `None` where that estimate is not positive, which no
    /// variance can be.
    pub design_effect: Option<f64>,
}

/// The clustered statistics of one cell from the moments of its clusters. Clusters without values do not count. `None`
/// for fewer than two clusters, for a confidence outside (0, 1), and if 128 bits do not suffice.
pub fn clustered(clusters: &[Moments], confidence: f64) -> Option<Clustered> {
    let parts: Vec<Moments> = clusters.iter().copied().filter(|part| part.n > 0).collect();
    let between = parts.len().checked_sub(1).filter(|&between| between > 0)? as f64;
    quantile::tail(confidence)?;
    let whole = Whole::of(&parts)?;
    let n = whole.n as f64;
    let se = (parts.len() as f64 / between * whole.deviations as f64).sqrt() / (n * n);
    let icc = whole.icc(&parts, between);
    let member_size = whole.squared_sizes as f64 / n;
    Some(Clustered {
        clusters: parts.len(),
        se,
        interval: student_t_of(whole.sum as f64 / n, se, between, confidence).filter(|_| se > 0.0),
        icc,
        design_effect: icc.map(|icc| 1.0 + (member_size - 1.0) * icc).filter(|&effect| effect > ROUNDING),
    })
}

/// The same for clusters of values 0 and 1: the bounds are inside (0, 1).
pub fn clustered_rate(clusters: &[Moments], confidence: f64) -> Option<Clustered> {
    let found = clustered(clusters, confidence)?;
    let (sum, n) = clusters.iter().fold((0, 0), |(sum, n), part| (sum + part.sum, n + part.n));
    let rate = sum as f64 / n as f64;
    let on_log_odds = || {
        let se = found.se / (rate * (1.0 - rate));
        let bounds = student_t_of((rate / (1.0 - rate)).ln(), se, found.clusters as f64 - 1.0, confidence)?;
        let back = |x: f64| quantile::settled(1.0 / (1.0 + (-x).exp()));
        Some(Interval { low: back(bounds.low), high: back(bounds.high) })
    };
    let interval = found.interval.and_then(|_| on_log_odds());
    Some(Clustered { interval, ..found })
}

/// The variance between clusters, at least 0, and the variance within them, by analysis of variance (Donner 1986).
/// `None` for fewer than two clusters, and if each has one value.
pub fn variance_components(clusters: &[Moments]) -> Option<(f64, f64)> {
    let parts: Vec<Moments> = clusters.iter().copied().filter(|part| part.n > 0).collect();
    let freedom = parts.len().checked_sub(1).filter(|&freedom| freedom > 0)? as f64;
    let [between, within, typical_size] = Whole::of(&parts)?.mean_squares(&parts, freedom)?;
    Some((((between - within) / typical_size).max(0.0), within))
}

/// Design effects up to this are zero up to rounding.
const ROUNDING: f64 = 1e-12;

struct Whole {
    n: i128,
    sum: i128,
    squared_sizes: i128,
    /// Sum over clusters of `(n * S_c - n_c * S)^2`, which is n^2 times the square of the residuals' sum.
    deviations: i128,
}

impl Whole {
    fn of(parts: &[Moments]) -> Option<Self> {
        let n = parts.iter().map(|part| i128::from(part.n)).sum();
        let sum = parts.iter().try_fold(0i128, |sum, part| sum.checked_add(part.sum))?;
        let squared_sizes = parts.iter().map(|part| i128::from(part.n) * i128::from(part.n)).sum();
        let mut whole = Self { n, sum, squared_sizes, deviations: 0 };
        for part in parts {
            let deviation = whole.deviation(part)?;
            whole.deviations = whole.deviations.checked_add(deviation.checked_mul(deviation)?)?;
        }
        Some(whole)
    }

    /// `n * n_c` times the cluster's mean minus the mean.
    fn deviation(&self, part: &Moments) -> Option<i128> {
        self.n.checked_mul(part.sum)?.checked_sub(self.sum.checked_mul(part.n.into())?)
    }

    fn mean_squares(&self, parts: &[Moments], between_freedom: f64) -> Option<[f64; 3]> {
        let n = self.n as f64;
        let within_freedom = n - parts.len() as f64;
        let (mut between, mut within) = (0.0, 0.0);
        for part in parts {
            let size = part.n as f64;
            let deviation = self.deviation(part)? as f64 / n;
            between += deviation * deviation / size;
            within += i128::from(part.n).checked_mul(part.sum_sq)?.checked_sub(part.sum.checked_mul(part.sum)?)? as f64
                / size;
        }
        let typical_size = (n - self.squared_sizes as f64 / n) / between_freedom;
        (within_freedom > 0.0).then(|| [between / between_freedom, within / within_freedom, typical_size])
    }

    fn icc(&self, parts: &[Moments], between_freedom: f64) -> Option<f64> {
        let [between, within, typical_size] = self.mean_squares(parts, between_freedom)?;
        let total = between + (typical_size - 1.0) * within;
        (total > 0.0).then(|| (between - within) / total)
    }
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::clustered;
    use mirrorstats_exact::moments::Moments;
    use mirrorstats_exact::moments::StandardError::Sample;

    fn of(values: &[i64]) -> Moments {
        values.iter().fold(Moments::default(), |m, &v| m.with(v).unwrap())
    }

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-10 * expected.abs().max(1.0), "found {found}, expected {expected}");
    }

    // statsmodels 0.15.0: OLS(y, ones).fit(cov_type="cluster", cov_kwds={"groups": g, "use_correction": False}),
    // bse * sqrt(C / (C - 1)), scipy 1.17.1 t.ppf(0.975, C - 1); mean squares by numpy, checked with f_oneway.
    #[test]
    fn three_seeds_of_seven_runs_match_known_values() {
        let found =
            clustered(&[of(&[1, 1, 1, 0, 1, 1, 1]), of(&[0, 0, 1, 0, 0, 0, 0]), of(&[1, 1, 0, 1, 0, 1, 0])], 0.95)
                .unwrap();
        assert_eq!(found.clusters, 3);
        close(found.se, 0.20756661635907953);
        close(found.interval.unwrap().low, -0.369277544672729);
        close(found.interval.unwrap().high, 1.4168965922917767);
        close(found.icc.unwrap(), 0.3488372093023256);
        close(found.design_effect.unwrap(), 3.0930232558139537);
    }

    // scipy 1.17.1: f_oneway of the three seeds above is 4.75; the mean squares are 4.75 and 1 times 4/21.
    #[test]
    fn the_variance_of_a_rate_is_split_into_clusters_and_repeats() {
        let seeds = [of(&[1, 1, 1, 0, 1, 1, 1]), of(&[0, 0, 1, 0, 0, 0, 0]), of(&[1, 1, 0, 1, 0, 1, 0])];
        let (between, within) = super::variance_components(&seeds).unwrap();
        close(within, 4.0 / 21.0);
        close(between, (4.75 - 1.0) * 4.0 / 21.0 / 7.0);
        assert_eq!(super::variance_components(&[of(&[1]), of(&[0])]), None);
        close(super::variance_components(&[of(&[1, 0]), of(&[1, 0])]).unwrap().0, 0.0);
    }

    #[test]
    fn fewer_clusters_are_needed_for_a_weaker_level() {
        assert_eq!([0.05, 0.2, 0.01, 1.0].map(super::fewest_clusters), [6, 4, 8, 1]);
    }

    #[test]
    fn clusters_of_unequal_size_match_known_values() {
        let found = clustered(&[of(&[3, 5, 4]), of(&[9, 8, 12, 10, 7]), of(&[1, 6])], 0.95).unwrap();
        close(found.se, 2.0291623887703016);
        close(found.interval.unwrap().low, -2.2307810911474775);
        close(found.icc.unwrap(), 0.7141283479684009);
        close(found.design_effect.unwrap(), 2.9995593743115223);
    }

    #[test]
    fn clusters_of_one_have_the_plain_standard_error() {
        let values = [3, 5, 4, 9, 8];
        let found = clustered(&values.map(|v| of(&[v])), 0.95).unwrap();
        close(found.se, of(&values).se(Sample).unwrap());
        assert_eq!((found.icc, found.design_effect), (None, None));
    }

    #[test]
    fn too_few_clusters_have_no_interval() {
        assert_eq!(clustered(&[], 0.95), None);
        assert_eq!(clustered(&[of(&[1, 0, 1]), of(&[])], 0.95), None);
        let alike = clustered(&[of(&[1, 1]), of(&[1, 1])], 0.95).unwrap();
        assert_eq!((alike.se, alike.icc, alike.interval), (0.0, None, None));
    }

    // Python, the analysis of variance written out in fractions: icc = -1/2, and 1 + (6 - 1) * icc = -3/2, which is
    // impossible for a ratio of variances.
    #[test]
    fn a_design_effect_is_never_negative() {
        let clusters = [of(&[1, 1, 0, 0, 1, 0, 1, 0]), of(&[1, 0]), of(&[1, 0])];
        let found = clustered(&clusters, 0.95).unwrap();
        close(found.icc.unwrap(), -0.5);
        assert_eq!((found.design_effect, found.interval), (None, None));
    }

    // statsmodels 0.15.0 as above for the standard error; scipy 1.17.1: expit(logit(p) -+ t.ppf(0.975, 2) * se / (p * (1 - p)))
    #[test]
    fn a_rate_by_clusters_stays_inside_its_range() {
        let found = super::clustered_rate(
            &[of(&[1, 1, 1, 0, 1, 1, 1]), of(&[0, 0, 1, 0, 0, 0, 0]), of(&[1, 1, 0, 1, 0, 1, 0])],
            0.95,
        )
        .unwrap();
        let interval = found.interval.unwrap();
        close(found.se, 0.20756661635907953);
        close(interval.low, 0.029737520495573516);
        close(interval.high, 0.9752960382188186);
    }
}
