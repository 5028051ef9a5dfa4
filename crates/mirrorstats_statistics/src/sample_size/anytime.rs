//! A study with interim looks: the e-values of `sequential`, at planned looks.

use super::Power;
use crate::sequential::against_level;
use mirrorstats_exact::ratio::Ratio;

/// The most episodes of a plan with looks; the outcomes grow with the third power.
pub const MOST_AT_LOOKS: u64 = 600;

/// An anytime-valid test with a look after each `every` episodes. An outcome is a loss, a tie or a win: for pairs,
/// which model alone succeeds; for one model, failure or success.
#[derive(Clone, Debug)]
pub struct Anytime {
    level: f64,
    every: u64,
    shares: [f64; 3],
    hypothesis: Ratio,
    within: Vec<(u64, u64)>,
    running: Vec<Vec<f64>>,
    stopped: Vec<f64>,
}

impl Anytime {
    /// Pairs with the discordant share `discordance`, so that the rates are `difference` apart.
    pub fn pairs(level: f64, every: u64, difference: f64, discordance: f64) -> Option<Self> {
        let [better, worse] = [difference, -difference].map(|sign| f64::midpoint(discordance, sign).max(0.0));
        Some(Self::new(level, every, [worse, 1.0 - discordance, better], Ratio::new(1, 2)?))
    }

    pub fn rate(level: f64, every: u64, chance: Ratio, rate: f64) -> Self {
        Self::new(level, every, [1.0 - rate, 0.0, rate], chance)
    }

    fn new(level: f64, every: u64, shares: [f64; 3], hypothesis: Ratio) -> Self {
        let (within, running, stopped) = (Vec::new(), vec![vec![1.0]], Vec::new());
        Self { level, every, shares, hypothesis, within, running, stopped }
    }

    pub fn boundary(&self) -> f64 {
        self.level.recip()
    }

    /// The expected number of episodes of a study that stops at its first rejection, or after `n`.
    pub fn expected(&mut self, n: u64) -> f64 {
        self.run(n);
        let looks = (1..).zip(&self.stopped).take_while(|(look, _)| look * self.every <= n);
        let (stopped, sum) = looks.fold((0.0, 0.0), |(stopped, sum), (look, probability)| {
            (stopped + probability, sum + probability * (look * self.every) as f64)
        });
        sum + (1.0 - stopped) * n as f64
    }

    fn run(&mut self, n: u64) {
        while (self.stopped.len() as u64 + 1) * self.every <= n {
            (0..self.every).for_each(|_| self.step());
            let stopped = self.look();
            self.stopped.push(stopped);
        }
    }

    /// Adds one episode; `running[d][w]` is the probability of w wins among d wins and losses.
    fn step(&mut self) {
        let [lost, none, won] = self.shares;
        let mut next: Vec<Vec<f64>> = (0..=self.running.len()).map(|decided| vec![0.0; decided + 1]).collect();
        for (decided, row) in self.running.iter().enumerate() {
            for (wins, probability) in row.iter().enumerate().filter(|(_, probability)| **probability > 0.0) {
                next[decided][wins] += none * probability;
                next[decided + 1][wins] += lost * probability;
                next[decided + 1][wins + 1] += won * probability;
            }
        }
        self.running = next;
    }

    fn look(&mut self) -> f64 {
        for decided in self.within.len() as u64..self.running.len() as u64 {
            let bounds = self.bounds(decided);
            self.within.push(bounds);
        }
        let mut rejected = 0.0;
        for (row, &(least, most)) in self.running.iter_mut().zip(&self.within) {
            for (_, probability) in (0..).zip(row).filter(|(wins, _)| *wins < least || *wins > most) {
                rejected += std::mem::take(probability);
            }
        }
        rejected
    }

    fn bounds(&self, decided: u64) -> (u64, u64) {
        let rejects = |wins: &u64| {
            against_level(*wins, decided, self.hypothesis).is_some_and(|evidence| evidence.p <= self.level)
        };
        let (least, most) = self.within.last().copied().unwrap_or_default();
        let least = (least..=decided).find(|wins| !rejects(wins)).unwrap_or(decided);
        let most = (most.max(least)..decided).find(|wins| rejects(&(wins + 1))).unwrap_or(decided);
        (least, most)
    }
}

impl Power for Anytime {
    fn power(&mut self, n: u64) -> f64 {
        self.run(n);
        let looks = usize::try_from(n / self.every).unwrap_or(usize::MAX);
        self.stopped.iter().take(looks).sum::<f64>().min(1.0)
    }

    fn most(&self) -> u64 {
        MOST_AT_LOOKS
    }
}
