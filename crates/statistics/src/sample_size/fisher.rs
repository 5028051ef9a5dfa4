//! Unpaired episodes of two models: Fisher's exact test.

use super::binomial::{from_mode, likely, probabilities};
use super::{Power, Rates, TIE};

/// The exact two-sided test of no difference between two rates with equal numbers of episodes, by probability: a table
/// is extreme if it is at most as probable as the observed one, given the totals.
#[derive(Clone, Copy, Debug)]
pub struct Fisher {
    /// The level that p must not exceed.
    pub level: f64,
    /// The true rates.
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
            let counts = (from..=to).filter(|successes| rejects[at(successes - fewest)]);
            counts.map(|successes| first[at(successes)] * second[at(total - successes)]).sum()
        };
        (of_first.start() + of_second.start()..=of_first.end() + of_second.end()).map(rejected).sum()
    }
}

fn at(count: u64) -> usize {
    usize::try_from(count).expect("a count of episodes")
}

#[expect(clippy::cast_precision_loss, reason = "counts of episodes are far below 2^53")]
fn rejections(n: u64, total: u64, level: f64) -> Vec<bool> {
    let first = total.saturating_sub(n);
    let last = total.min(n);
    // P(x + 1) / P(x) of the hypergeometric distribution with both samples of n.
    let ratio = |at: u64| {
        let x = first + at;
        ((n - x) as f64 * (total - x) as f64) / ((x + 1) as f64 * (n + x + 1 - total) as f64)
    };
    let probabilities = from_mode(last - first, (total / 2).clamp(first, last) - first, ratio);
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
