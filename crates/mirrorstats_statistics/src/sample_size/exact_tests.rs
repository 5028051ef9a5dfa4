//! The exact tests of fixed size: pairs (`McNemar`), unpaired episodes (Fisher), one rate against a level (binomial).

use super::{Power, Rates};
use crate::chance;
use crate::comparisons::unpaired::tables;
use crate::outcomes::{Outcomes, TIE, size};
use mirrorstats_exact::ratio::Ratio;

/// The exact two-sided test of no difference over pairs, whose power depends only on the discordant pairs.
#[derive(Clone, Debug)]
pub struct McNemar {
    level: f64,
    discordance: f64,
    favours: f64,
    rejects: Vec<f64>,
}

impl McNemar {
    /// Pairs with the discordant share `discordance`, so that the rates are `difference` apart. The discordance is at
    /// least the difference.
    pub fn new(level: f64, difference: f64, discordance: f64) -> Self {
        let share = if discordance > 0.0 { difference / discordance } else { 0.0 };
        Self { level, discordance, favours: f64::midpoint(1.0, share).min(1.0), rejects: Vec::new() }
    }

    /// The probability of a rejection with this number of discordant pairs: both tails of the binomial, up to the count
    /// at which twice the tail under 1/2 is at most the level.
    fn rejects(&self, discordant: u64) -> f64 {
        let even = probabilities(discordant, 0.5);
        let mut tail = 0.0;
        let within = |probability: &&f64| {
            tail += **probability;
            2.0 * tail <= self.level * (1.0 + TIE)
        };
        let reach = even.iter().take_while(within).count();
        let true_ones = probabilities(discordant, self.favours);
        true_ones[..reach].iter().sum::<f64>() + true_ones[true_ones.len() - reach..].iter().sum::<f64>()
    }
}

impl Power for McNemar {
    fn power(&mut self, n: u64) -> f64 {
        for discordant in self.rejects.len() as u64..=n {
            self.rejects.push(self.rejects(discordant));
        }
        probabilities(n, self.discordance).iter().zip(&self.rejects).map(|(a, b)| a * b).sum::<f64>().min(1.0)
    }
}

/// The exact two-sided test of no difference between two rates with equal numbers of episodes, by probability: a table
/// is extreme if it is at most as probable as the observed one, given the totals.
#[derive(Clone, Copy, Debug)]
pub struct Fisher {
    pub level: f64,
    pub rates: Rates,
}

impl Power for Fisher {
    fn power(&mut self, n: u64) -> f64 {
        let (first, second) = (probabilities(n, self.rates.lower), probabilities(n, self.rates.higher));
        let (of_first, of_second) = (likely(&first), likely(&second));
        let rejected = |total: u64| -> f64 {
            let fewest = total.saturating_sub(n);
            let rejects = rejections(n, total, self.level);
            let from = (*of_first.start()).max(total.saturating_sub(*of_second.end()));
            let to = (*of_first.end()).min(total.saturating_sub(*of_second.start()));
            let counts = (from..=to).filter(|successes| rejects[size(successes - fewest)]);
            counts.map(|successes| first[size(successes)] * second[size(total - successes)]).sum()
        };
        let totals = of_first.start() + of_second.start()..=of_first.end() + of_second.end();
        totals.map(rejected).sum::<f64>().min(1.0)
    }
}

/// Returns true for each extreme table with this total. The tables begin with the fewest successes of the first side.
fn rejections(n: u64, total: u64, level: f64) -> Vec<bool> {
    let (first, last) = (total.saturating_sub(n), total.min(n));
    let tables = tables((last, n), (total - last, n)).expect("no more successes than episodes");
    let probabilities = &tables.probabilities(last)[size(first)..];
    // The least probable first: both tails fall away from the mode, so the next is the smaller of the two ends.
    let mut rejects = vec![false; probabilities.len()];
    let (mut low, mut beyond, mut sum) = (0, probabilities.len(), 0.0);
    while low < beyond {
        let (a, b) = (probabilities[low], probabilities[beyond - 1]);
        let limit = a.min(b) * (1.0 + TIE);
        let (takes_low, takes_high) = (a <= limit, b <= limit && beyond - 1 > low);
        sum += if takes_low { a } else { 0.0 } + if takes_high { b } else { 0.0 };
        if sum > level * (1.0 + TIE) {
            break;
        }
        if takes_low {
            rejects[low] = true;
            low += 1;
        }
        if takes_high || !takes_low {
            beyond -= 1;
            rejects[beyond] = true;
        }
    }
    rejects
}

/// The exact two-sided test of one rate against a level of chance.
#[derive(Clone, Copy, Debug)]
pub struct OneRate {
    pub level: f64,
    pub chance: Ratio,
    pub rate: f64,
}

impl Power for OneRate {
    fn power(&mut self, n: u64) -> f64 {
        let probabilities = probabilities(n, self.rate);
        let rejects = |successes: &u64| chance::two_sided(*successes, n, self.chance).is_some_and(|p| p <= self.level);
        let counts = likely(&probabilities).filter(rejects);
        counts.map(|successes| probabilities[size(successes)]).sum::<f64>().min(1.0)
    }
}

/// The probability of each number of successes in `n` trials with this rate. Only additions, products and quotients,
/// so all machines get the same bits; underflow gives 0.
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
fn likely(probabilities: &[f64]) -> std::ops::RangeInclusive<u64> {
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
