//! Pairs of episodes: the exact test of `McNemar`, whose power depends only on the discordant pairs.

use super::binomial::probabilities;
use super::{Power, TIE};

/// The exact two-sided test of no difference over pairs.
#[derive(Clone, Debug)]
pub struct McNemar {
    level: f64,
    discordance: f64,
    favours: f64,
    rejects: Vec<f64>,
}

impl McNemar {
    /// Pairs with the discordant share `discordance`, so that the rates are `difference` apart.
    ///
    /// The discordance is at least the difference.
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
        probabilities(n, self.discordance).iter().zip(&self.rejects).map(|(a, b)| a * b).sum()
    }
}
