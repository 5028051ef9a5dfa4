//! Non-inferiority of a rate within a margin: score tests of pairs and of independent units.
//!
//! Rule: a unit counts once, as the mean of its episodes. A mean varies at most as much as a single verdict, so the
//! variance under the null hypothesis is never too small. Up to `MOST_ENUMERATED` outcomes the p value is exact: the
//! maximum over the rate that the null hypothesis leaves open (Chan 1998). Beyond, it is the normal approximation.

use crate::intervals::clustered::fewest_clusters;
use crate::intervals::interval::Interval;
use crate::intervals::quantile::{normal, normal_below};
use crate::power::POWER;

const MOST_ENUMERATED: usize = 6000;
/// The number of values tried for the rate that the null hypothesis leaves open.
const NUISANCE: u32 = 100;
const TIE: f64 = 1e-9;

/// The units of two sides: shared units with the means of both, and units of one side alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Units {
    /// The means of the first and of the second side.
    pub shared: Vec<(f64, f64)>,
    pub first: Vec<f64>,
    pub second: Vec<f64>,
}

/// Gains, losses and the number of pairs; partial verdicts count as fractions.
#[derive(Clone, Copy)]
struct PairCounts {
    gains: f64,
    losses: f64,
    n: f64,
}

/// Successes and the number of units of two sides.
#[derive(Clone, Copy)]
struct SideCounts {
    successes: [f64; 2],
    n: [f64; 2],
}

impl Units {
    fn pairs(&self) -> Option<PairCounts> {
        let differences = || self.shared.iter().map(|(a, b)| a - b);
        let gains = differences().map(|difference| difference.max(0.0)).sum();
        let losses = differences().map(|difference| (-difference).max(0.0)).sum();
        (!self.shared.is_empty()).then_some(PairCounts { gains, losses, n: self.shared.len() as f64 })
    }

    fn sides(&self) -> Option<SideCounts> {
        let (first, second) = (&self.first, &self.second);
        (!first.is_empty() && !second.is_empty()).then(|| SideCounts {
            successes: [first.iter().sum(), second.iter().sum()],
            n: [first.len() as f64, second.len() as f64],
        })
    }

    /// The units on the smaller side, including pairs.
    pub fn len(&self) -> u64 {
        (self.shared.len() + self.first.len().min(self.second.len())) as u64
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The one-sided p value of the hypothesis that the first rate is below the second by `margin` or more. Pairs and
    /// other units are independent samples: their p values are combined with the square roots of their sizes as weights
    /// (Stouffer). `None` without units to compare, and for a margin outside (0, 1).
    pub fn non_inferior(&self, margin: f64) -> Option<f64> {
        if !(margin > 0.0 && margin < 1.0) {
            return None;
        }
        let pairs = self.pairs().map(|pairs| (pairs.p(margin), pairs.n));
        let sides = self.sides().map(|sides| (sides.p(margin), sides.n[0] * sides.n[1] / (sides.n[0] + sides.n[1])));
        match (pairs, sides) {
            (Some((p, _)), None) | (None, Some((p, _))) => Some(p),
            (None, None) => None,
            (Some((p, m)), Some((q, n))) => {
                let deviate = |p: f64| normal(p.clamp(1e-15, 1.0 - 1e-15));
                let sum = m.sqrt() * deviate(p) + n.sqrt() * deviate(q);
                Some(normal_below(-sum / (m + n).sqrt()))
            }
        }
    }

    /// The spread of the difference, after adding half a success and half a failure.
    pub fn spread(&self) -> Option<Spread> {
        let share = |successes: f64, n: f64| (successes + 0.5) / (n + 1.0);
        let pairs = self.pairs().map(|PairCounts { gains, losses, n }| {
            let (gained, lost) = (share(gains, n), share(losses, n));
            ((gains - losses) / n, gained + lost - (gained - lost).powi(2), n)
        });
        let sides = self.sides().map(|SideCounts { successes: [a, b], n: [m, n] }| {
            let (p, q) = (share(a, m), share(b, n));
            (a / m - b / n, p * (1.0 - p) + q * (1.0 - q), m.min(n))
        });
        let all: Vec<(f64, f64, f64)> = pairs.into_iter().chain(sides).collect();
        let weight: f64 = all.iter().map(|part| part.2).sum();
        let mean = |of: fn(&(f64, f64, f64)) -> f64| all.iter().map(|part| of(part) * part.2).sum::<f64>() / weight;
        let spread = || Spread { gain: mean(|part| part.0), variance: mean(|part| part.1), units: self.len() };
        (weight > 0.0).then(spread)
    }
}

/// The variance of a difference, from which a number of units is planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The difference; positive is better.
    pub gain: f64,
    /// The variance that one unit contributes.
    pub variance: f64,
    pub units: u64,
}

impl Spread {
    /// The spread implied by the interval of a mean difference.
    pub fn of_interval(gain: f64, interval: Interval, confidence: f64, units: u64) -> Self {
        let se = (interval.high - interval.low) / (2.0 * normal(f64::midpoint(1.0, confidence)));
        Self { gain, variance: units as f64 * se * se, units }
    }

    /// The number of units per side that makes one verdict likely, if the difference stays unchanged. `level` is
    /// two-sided for a difference and one-sided for the margin; the power is 0.8. `None` if more units bring no verdict
    /// closer. At least as many as any exact test needs. If so many gave no verdict yet, the approximation is too
    /// optimistic here, and the answer is twice as many.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number, bounded above")]
    pub fn settling(self, margin: f64, level: f64) -> Option<u64> {
        let needed = |distance: f64, tail: f64| {
            (self.variance * ((normal(tail) + normal(1.0 - POWER)) / distance).powi(2)).max(0.0)
        };
        let told_apart = needed(self.gain, level / 2.0);
        let within = if self.gain > -margin { needed(self.gain + margin, level) } else { f64::INFINITY };
        let least = told_apart.min(within).ceil();
        let fewest = fewest_clusters(level) as u64;
        let settling = || (least as u64).max(fewest);
        (least.is_finite() && least < 1e9).then(|| if settling() > self.units { settling() } else { 2 * self.units })
    }
}

impl PairCounts {
    /// The score statistic of Tango (1998) for a difference of at most `-margin`.
    fn score(self, margin: f64) -> f64 {
        let Self { gains, losses, n } = self;
        let least = -margin;
        let b = gains + losses + least * (gains - losses) - 2.0 * n * least;
        let root = (b * b + 8.0 * n * losses * least * (1.0 - least)).max(0.0).sqrt();
        let lost = ((b + root) / (4.0 * n)).clamp(margin, f64::midpoint(1.0, margin));
        let variance = n * (2.0 * lost + least - least * least);
        (gains - losses - n * least) / variance.max(f64::MIN_POSITIVE).sqrt()
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of units")]
    fn p(self, margin: f64) -> f64 {
        let n = self.n as usize;
        let seen = self.score(margin) - TIE;
        if (n + 1) * (n + 2) / 2 > MOST_ENUMERATED {
            return normal_below(-seen);
        }
        let score = |gains, losses| Self { gains: real(gains), losses: real(losses), n: self.n }.score(margin);
        let all = (0..=n).flat_map(|gains| (0..=n - gains).map(move |losses| (gains, losses)));
        let beyond: Vec<_> = all.filter(|&(gains, losses)| score(gains, losses) >= seen).collect();
        let factorials = log_factorials(n);
        let most = f64::midpoint(1.0, margin);
        largest(margin, most, |lost| {
            let gained = lost - margin;
            // Up to 108 units, the factorials and their products are far from the limits of a double.
            let [gained, lost, even] = [gained, lost, 1.0 - gained - lost]
                .map(|p| (0..=n).map(|k| power(&factorials, k, p).exp()).collect::<Vec<f64>>());
            let terms = beyond.iter().map(|&(gains, losses)| gained[gains] * lost[losses] * even[n - gains - losses]);
            factorials[n].exp() * terms.sum::<f64>()
        })
    }
}

impl SideCounts {
    /// The score statistic of Farrington and Manning (1990) for a difference of at most `-margin`.
    fn score(self, margin: f64) -> f64 {
        let Self { successes: [a, b], n: [m, n] } = self;
        let second = restricted([a, b], [m, n], margin);
        let first = second - margin;
        let variance = first * (1.0 - first) / m + second * (1.0 - second) / n;
        (a / m - b / n + margin) / variance.max(f64::MIN_POSITIVE).sqrt()
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of units")]
    fn p(self, margin: f64) -> f64 {
        let [m, n] = self.n.map(|n| n as usize);
        let seen = self.score(margin) - TIE;
        if (m + 1) * (n + 1) > MOST_ENUMERATED {
            return normal_below(-seen);
        }
        let at = |a: usize, b: usize| Self { successes: [real(a), real(b)], n: self.n };
        let all = (0..=m).flat_map(|a| (0..=n).map(move |b| (a, b)));
        let beyond: Vec<_> = all.filter(|&(a, b)| at(a, b).score(margin) >= seen).collect();
        let factorials = log_factorials(m.max(n));
        largest(margin, 1.0, |second| {
            let first = second - margin;
            let of = |k: usize, n: usize, p: f64| {
                (factorials[n] + power(&factorials, k, p) + power(&factorials, n - k, 1.0 - p)).exp()
            };
            let firsts: Vec<f64> = (0..=m).map(|a| of(a, m, first)).collect();
            let seconds: Vec<f64> = (0..=n).map(|b| of(b, n, second)).collect();
            beyond.iter().map(|&(a, b)| firsts[a] * seconds[b]).sum()
        })
    }
}

/// The maximum-likelihood second rate if the first is lower by `margin`; the likelihood rises, then falls. By Newton's
/// method, within bounds that halve where it leaves them.
fn restricted([a, b]: [f64; 2], [m, n]: [f64; 2], margin: f64) -> f64 {
    // The slope of the log-likelihood, and how fast it falls.
    let slope = |second: f64| {
        let part = |successes: f64, n: f64, p: f64| {
            let won = if successes > 0.0 { successes / p } else { 0.0 };
            let lost = if n > successes { (n - successes) / (1.0 - p) } else { 0.0 };
            (won - lost, won / p + lost / (1.0 - p))
        };
        let (first, second) = (part(a, m, second - margin), part(b, n, second));
        (first.0 + second.0, first.1 + second.1)
    };
    let (mut low, mut high) = (margin, 1.0);
    let mut at = f64::midpoint(low, high);
    for _ in 0..60 {
        let (value, fall) = slope(at);
        let bound = if value > 0.0 { &mut low } else { &mut high };
        *bound = at;
        let next = at + value / fall;
        let next = if low < next && next < high { next } else { f64::midpoint(low, high) };
        if (next - at).abs() < 1e-16 {
            break;
        }
        at = next;
    }
    at
}

fn largest(low: f64, high: f64, of: impl Fn(f64) -> f64) -> f64 {
    let at = |step: u32| low + (high - low) * f64::from(step) / f64::from(NUISANCE);
    (0..=NUISANCE).map(|step| of(at(step))).fold(0.0, f64::max).min(1.0)
}

fn log_factorials(n: usize) -> Vec<f64> {
    let sums = (1..=n).scan(0.0, |sum, k| {
        *sum += real(k).ln();
        Some(*sum)
    });
    std::iter::once(0.0).chain(sums).collect()
}

/// The logarithm of `p` to the power of `k`, divided by the factorial of `k`.
fn power(factorials: &[f64], k: usize, p: f64) -> f64 {
    match (k, p > 0.0) {
        (0, _) => 0.0,
        (_, false) => f64::NEG_INFINITY,
        (k, true) => real(k) * p.ln() - factorials[k],
    }
}

const fn real(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
mod tests {
    use super::Units;

    fn pairs(gains: usize, losses: usize, n: usize) -> Units {
        let shared = (0..n).map(|at| match at {
            at if at < gains => (1.0, 0.0),
            at if at < gains + losses => (0.0, 1.0),
            _ => (1.0, 1.0),
        });
        Units { shared: shared.collect(), ..Units::default() }
    }

    fn sides(successes: [usize; 2], n: [usize; 2]) -> Units {
        let of = |side: usize| (0..n[side]).map(|at| f64::from(u8::from(at < successes[side]))).collect();
        Units { shared: Vec::new(), first: of(0), second: of(1) }
    }

    fn close(found: Option<f64>, expected: f64) {
        assert!((found.unwrap() - expected).abs() < 1e-6, "{found:?}, not {expected}");
    }

    // scipy 1.17.1: the score maximised by minimize_scalar, all outcomes enumerated over 101 rates by multinomial.pmf and
    // binom.pmf; beyond the enumeration norm.sf.
    #[test]
    fn small_samples_are_exact_and_large_ones_normal() {
        close(pairs(2, 1, 21).non_inferior(0.1), 0.09076299035892627);
        close(pairs(0, 0, 29).non_inferior(0.1), 0.0486221739187105);
        close(pairs(3, 1, 12).non_inferior(0.2), 0.030281450692372924);
        close(pairs(5, 9, 200).non_inferior(0.1), 0.0005124150668489438);
        close(sides([18, 17], [21, 21]).non_inferior(0.2), 0.025126218896629842);
        close(sides([12, 11], [12, 12]).non_inferior(0.3), 0.005518912323483079);
        close(sides([180, 175], [200, 200]).non_inferior(0.1), 9.829979519800933e-05);
    }

    #[test]
    fn repeats_of_a_unit_count_once_and_no_units_give_no_test() {
        let repeated = Units { shared: vec![(2.0 / 3.0, 2.0 / 3.0); 3], ..Units::default() };
        close(repeated.non_inferior(0.1), 0.9_f64.powi(3));
        assert_eq!(Units::default().non_inferior(0.1), None);
        for margin in [0.0, 1.0, -0.1, f64::NAN] {
            assert_eq!(pairs(0, 0, 9).non_inferior(margin), None);
        }
        // Pairs and other units together have more power than either alone.
        let both = Units { first: vec![1.0; 21], second: vec![1.0; 21], ..pairs(0, 0, 21) };
        assert!(both.non_inferior(0.1).unwrap() < pairs(0, 0, 21).non_inferior(0.1).unwrap());
    }

    // (norm.isf(0.05) + norm.isf(0.2)) ** 2 is 6.182557232; half of one of 21 pairs in each direction: variance 1/22.
    #[test]
    fn the_number_needed_follows_from_the_normal_approximation() {
        assert_eq!(pairs(0, 0, 21).spread().unwrap().settling(0.1, 0.05), Some(29));
        assert_eq!(pairs(0, 2, 21).spread().unwrap().settling(0.1, 0.05).map(|n| n > 100), Some(true));
    }
}
