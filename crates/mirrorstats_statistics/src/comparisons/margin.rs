//! A margin, an interval and the reach of a difference of rates: score tests of pairs and of independent units.
//!
//! Rule: a unit counts once, as the mean of its episodes. A mean varies at most as much as a single verdict, so the
//! variance under the null hypothesis is never too small. Up to `MOST_ENUMERATED` outcomes the p value is exact: the
//! maximum over the rate that the null hypothesis leaves open (Chan 1998). Beyond, it is the normal approximation.

use crate::comparisons::paired::Pairs;
use crate::comparisons::units::Sides;
use crate::intervals::clustered::fewest_clusters;
use crate::intervals::interval::Interval;
use crate::intervals::quantile::{normal, normal_below, settled, tail};
use crate::power::POWER;
use crate::sample_size::{Fisher, McNemar, Power as _, Rates, smallest};
use mirrorstats_exact::moments::Moments;

const MOST_ENUMERATED: usize = 6000;
/// The number of values tried for the rate that the null hypothesis leaves open.
const NUISANCE: u32 = 100;
const TIE: f64 = 1e-9;
/// The most units whose power is enumerated; beyond, the normal approximation has two correct digits.
const MOST_EXACT: u64 = 100;

/// The counts of two sides: of shared units, and of units of one side alone. Partial verdicts count as fractions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    pairs: Option<PairCounts>,
    sides: Option<SideCounts>,
}

/// Gains, losses and the number of pairs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PairCounts {
    gains: f64,
    losses: f64,
    n: f64,
}

/// Successes and the number of units of two sides.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SideCounts {
    successes: [f64; 2],
    n: [f64; 2],
}

impl Counts {
    pub fn of_units(Sides { shared, first, second }: &Sides) -> Self {
        let mean = |unit: &Moments| unit.mean().unwrap_or_default();
        let differences = || shared.iter().map(|(a, b)| mean(a) - mean(b));
        let gains = differences().map(|difference| difference.max(0.0)).sum();
        let losses = differences().map(|difference| (-difference).max(0.0)).sum();
        let pairs = PairCounts { gains, losses, n: shared.len() as f64 };
        let successes = [first, second].map(|side| side.iter().map(mean).sum());
        let sides = SideCounts { successes, n: [first, second].map(|side| side.len() as f64) };
        Self { pairs: Some(pairs).filter(|it| it.n > 0.0), sides: Some(sides).filter(SideCounts::is_two) }
    }

    pub fn of_pairs(pairs: Pairs) -> Self {
        let [gains, losses, n] = [pairs.first_only, pairs.second_only, pairs.n()].map(|count| count as f64);
        Self { pairs: (n > 0.0).then_some(PairCounts { gains, losses, n }), sides: None }
    }

    /// The successes and episodes of each side.
    pub fn of_sides(sides: [(u64, u64); 2]) -> Self {
        let sides = SideCounts { successes: sides.map(|side| side.0 as f64), n: sides.map(|side| side.1 as f64) };
        Self { pairs: None, sides: Some(sides).filter(SideCounts::is_two) }
    }

    /// The second side minus the first.
    #[must_use]
    pub fn swapped(self) -> Self {
        let pairs = |PairCounts { gains, losses, n }| PairCounts { gains: losses, losses: gains, n };
        let sides = |SideCounts { successes: [a, b], n: [m, n] }| SideCounts { successes: [b, a], n: [n, m] };
        Self { pairs: self.pairs.map(pairs), sides: self.sides.map(sides) }
    }

    /// The units on the smaller side, including pairs.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of units")]
    pub fn len(self) -> u64 {
        let sides = self.sides.map_or(0.0, |sides| sides.n[0].min(sides.n[1]));
        (self.pairs.map_or(0.0, |pairs| pairs.n) + sides) as u64
    }

    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The one-sided p value of the hypothesis that the first rate is below the second by `margin` or more. Pairs and
    /// other units are independent samples: their p values are combined with the square roots of their sizes as weights
    /// (Stouffer). `None` without units to compare, and for a margin outside (0, 1).
    pub fn non_inferior(self, margin: f64) -> Option<f64> {
        if !(margin > 0.0 && margin < 1.0) {
            return None;
        }
        let pairs = self.pairs.map(|pairs| (pairs.p(margin), pairs.n));
        let sides = self.sides.map(|sides| (sides.p(margin), sides.weight() / 2.0));
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

    /// The p value of the hypothesis that the rates differ by `margin` or more: the larger one-sided p value of both
    /// directions (Schuirmann 1987).
    pub fn equivalent(self, margin: f64) -> Option<f64> {
        Some(self.non_inferior(margin)?.max(self.swapped().non_inferior(margin)?))
    }

    /// The score interval of the difference: pairs by Tango (1998), other units by Mee (1984). Where there are both, their
    /// differences have the weights of the exact test (`units::difference_test`). `None` without units to compare, and
    /// for a confidence outside (0, 1).
    pub fn interval(self, confidence: f64) -> Option<Interval> {
        let deviate = normal(tail(confidence)?);
        let (low, high) = (self.lowest(deviate)?, -self.swapped().lowest(deviate)?);
        Some(Interval { low: settled(low), high: settled(high) })
    }

    /// The smallest difference that the score test does not reject at this deviate.
    fn lowest(self, deviate: f64) -> Option<f64> {
        let score = |difference: f64| {
            let pairs = self.pairs.map(|pairs| (pairs.estimate(), pairs.variance(difference), pairs.n));
            let sides = self.sides.map(|sides| (sides.estimate(), sides.variance(difference), sides.weight()));
            let parts = || pairs.iter().chain(&sides);
            let excess: f64 = parts().map(|(estimate, _, weight)| weight * (estimate - difference)).sum();
            let variance: f64 = parts().map(|(_, variance, weight)| weight * weight * variance).sum();
            let estimate = parts().map(|(estimate, _, weight)| weight * estimate).sum::<f64>();
            (excess / variance.max(f64::MIN_POSITIVE).sqrt(), estimate / parts().map(|it| it.2).sum::<f64>())
        };
        let (at_least, estimate) = score(-1.0);
        if self.is_empty() || at_least <= deviate {
            return (!self.is_empty()).then_some(-1.0);
        }
        let (mut below, mut within) = (-1.0, estimate);
        for _ in 0..50 {
            let middle = f64::midpoint(below, within);
            if score(middle).0 > deviate { below = middle } else { within = middle }
        }
        Some(within)
    }

    /// The smallest true difference that the exact test of so many units shows with a probability of 0.8 at `level`: of
    /// pairs at their share of discordance, of other units around their mean rate. `None` if there is none.
    pub fn detectable(self, level: f64) -> Option<f64> {
        let n = self.len();
        if n > MOST_EXACT {
            return self.spread().map(|spread| spread.detectable(level));
        }
        if let Some(SideCounts { successes: [a, b], n: [m, k] }) = self.sides {
            let lower = |difference: f64| ((a + b) / (m + k) - difference / 2.0).clamp(0.0, 1.0 - difference);
            let rates = |difference| Rates { lower: lower(difference), higher: lower(difference) + difference };
            return smallest(POWER, 1.0, |difference| Fisher { level, rates: rates(difference) }.power(n));
        }
        let discordant = self.pairs.map(|pairs| (pairs.gains + pairs.losses) / pairs.n)?;
        smallest(POWER, 1.0, |difference| McNemar::new(level, difference, discordant.max(difference)).power(n))
    }

    /// The spread of the difference, after adding half a success and half a failure.
    pub fn spread(self) -> Option<Spread> {
        let share = |successes: f64, n: f64| (successes + 0.5) / (n + 1.0);
        let pairs = self.pairs.map(|PairCounts { gains, losses, n }| {
            let (gained, lost) = (share(gains, n), share(losses, n));
            ((gains - losses) / n, gained + lost - (gained - lost).powi(2), n)
        });
        let sides = self.sides.map(|SideCounts { successes: [a, b], n: [m, n] }| {
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

    /// The smallest true difference that is shown with a probability of 0.8 at this two-sided level.
    pub fn detectable(self, level: f64) -> f64 {
        (normal(level / 2.0) + normal(1.0 - POWER)) * (self.variance / self.units as f64).sqrt()
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
    fn estimate(self) -> f64 {
        (self.gains - self.losses) / self.n
    }

    /// The variance of the estimate for this true difference, by the most likely share of losses (Tango 1998).
    fn variance(self, difference: f64) -> f64 {
        let Self { gains, losses, n } = self;
        let b = gains + losses + difference * (gains - losses) - 2.0 * n * difference;
        let root = (b * b + 8.0 * n * losses * difference * (1.0 - difference)).max(0.0).sqrt();
        let lost = ((b + root) / (4.0 * n)).clamp((-difference).max(0.0), (1.0 - difference) / 2.0);
        (2.0 * lost + difference - difference * difference) / n
    }

    /// The score statistic for a difference of at most `-margin`.
    fn score(self, margin: f64) -> f64 {
        (self.estimate() + margin) / self.variance(-margin).max(f64::MIN_POSITIVE).sqrt()
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
    fn is_two(&self) -> bool {
        self.n.iter().all(|n| *n > 0.0)
    }

    /// The harmonic mean of the sizes.
    fn weight(self) -> f64 {
        2.0 * self.n[0] * self.n[1] / (self.n[0] + self.n[1])
    }

    fn estimate(self) -> f64 {
        self.successes[0] / self.n[0] - self.successes[1] / self.n[1]
    }

    /// The variance of the estimate for this true difference, by the most likely rates.
    fn variance(self, difference: f64) -> f64 {
        let second = restricted(self.successes, self.n, -difference);
        let first = second + difference;
        first * (1.0 - first) / self.n[0] + second * (1.0 - second) / self.n[1]
    }

    /// The score statistic of Farrington and Manning (1990) for a difference of at most `-margin`.
    fn score(self, margin: f64) -> f64 {
        (self.estimate() + margin) / self.variance(-margin).max(f64::MIN_POSITIVE).sqrt()
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

/// The maximum-likelihood second rate if the first is lower by `margin`, or higher if that is negative. The likelihood
/// rises, then falls: by Newton's method, within bounds that halve where it leaves them.
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
    let (mut low, mut high) = (margin.max(0.0), 1.0 + margin.min(0.0));
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
    use super::{Counts, Interval, PairCounts};
    use crate::comparisons::units::Sides;
    use mirrorstats_exact::moments::Moments;

    fn pairs(gains: u32, losses: u32, n: u32) -> Counts {
        let [gains, losses, n] = [gains, losses, n].map(f64::from);
        Counts { pairs: Some(PairCounts { gains, losses, n }), sides: None }
    }

    fn sides(successes: [u64; 2], n: [u64; 2]) -> Counts {
        Counts::of_sides([0, 1].map(|side| (successes[side], n[side])))
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
        let unit = Moments::default().with_truths(1, 2).unwrap();
        let repeated = Counts::of_units(&Sides { shared: vec![(unit, unit); 3], ..Sides::default() });
        close(repeated.non_inferior(0.1), 0.9_f64.powi(3));
        assert_eq!(Counts::default().non_inferior(0.1), None);
        for margin in [0.0, 1.0, -0.1, f64::NAN] {
            assert_eq!(pairs(0, 0, 9).non_inferior(margin), None);
        }
        // Pairs and other units together have more power than either alone.
        let both = Counts { sides: sides([21, 21], [21, 21]).sides, ..pairs(0, 0, 21) };
        assert!(both.non_inferior(0.1).unwrap() < pairs(0, 0, 21).non_inferior(0.1).unwrap());
    }

    fn bounds(found: Option<Interval>, low: f64, high: f64) {
        let Interval { low: a, high: b } = found.unwrap();
        assert!((a - low).abs() < 1e-7 && (b - high).abs() < 1e-7, "{found:?}, not [{low}, {high}]");
    }

    // scipy 1.17.1: brentq over score statistics whose shares are minimize_scalar's. The same code gives the published
    // intervals by Mee's method of 56/70 - 48/80 (0.0533 to 0.3377) and 9/10 - 3/10 (Newcombe 1998, 17:873, table II).
    #[test]
    fn score_intervals_match_known_values() {
        bounds(pairs(2, 1, 21).interval(0.95), -0.15484121716527213, 0.25504228912865023);
        bounds(pairs(0, 0, 6).interval(0.95), -0.390334287902176, 0.390334287902176);
        bounds(pairs(7, 0, 7).interval(0.95), 0.29133912986662486, 1.0);
        bounds(sides([56, 48], [70, 80]).interval(0.95), 0.05333384928083425, 0.3377294637733367);
        bounds(sides([9, 3], [10, 10]).interval(0.95), 0.1821264998239676, 0.8369503311461316);
        bounds(sides([12, 0], [12, 12]).interval(0.95), 0.7240475906500395, 1.0);
        let of_both = Counts { sides: sides([5, 2], [6, 9]).sides, ..pairs(3, 1, 8) };
        bounds(of_both.interval(0.95), 0.06955168981882004, 0.6834946478084333);
        let thirds = Counts { pairs: Some(PairCounts { gains: 3.5, losses: 1.0 / 3.0, n: 12.0 }), sides: None };
        bounds(thirds.interval(0.95), -0.07504813932121189, 0.5564461679326226);
        assert_eq!((Counts::default().interval(0.95), pairs(1, 0, 9).interval(1.0)), (None, None));
    }

    // scipy 1.17.1: brentq over the power, all outcomes enumerated by binom.pmf with binomtest or fisher_exact; of 6 pairs
    // 0.8 ** (1 / 6); of 200 pairs (norm.isf(0.0125) + norm.isf(0.2)) * sqrt((15 / 201 - (4 / 201) ** 2) / 200).
    #[test]
    fn the_smallest_difference_that_would_have_been_shown_matches_known_values() {
        close(pairs(0, 0, 6).detectable(0.05), 0.9634924839989961);
        close(pairs(4, 3, 21).detectable(0.05 / 3.0), 0.40009419143095104);
        close(sides([9, 7], [12, 15]).detectable(0.05), 0.5870758413141641);
        close(sides([11, 2], [21, 21]).detectable(0.05 / 28.0), 0.5481496894021536);
        close(pairs(5, 9, 200).detectable(0.025), 0.05939557317573504);
        assert_eq!((pairs(0, 0, 5).detectable(0.05), Counts::default().detectable(0.05)), (None, None));
    }

    // scipy 1.17.1, as for one direction: 29 pairs without a difference, and 21 pairs with two gains and a loss, of which
    // the larger p value is that of a gain of the margin.
    #[test]
    fn equivalence_needs_both_directions() {
        close(pairs(0, 0, 29).equivalent(0.1), 0.0486221739187105);
        let [found, turned] = [pairs(2, 1, 21), pairs(1, 2, 21)].map(|it| it.equivalent(0.1));
        assert!(found == turned && found > pairs(2, 1, 21).non_inferior(0.1), "{found:?}");
    }

    // (norm.isf(0.05) + norm.isf(0.2)) ** 2 is 6.182557232; half of one of 21 pairs in each direction: variance 1/22.
    #[test]
    fn the_number_needed_follows_from_the_normal_approximation() {
        assert_eq!(pairs(0, 0, 21).spread().unwrap().settling(0.1, 0.05), Some(29));
        assert_eq!(pairs(0, 2, 21).spread().unwrap().settling(0.1, 0.05).map(|n| n > 100), Some(true));
    }
}
