//! The rates at which durations of unequal numbers of episodes give a false or a true claim.

use mirrorstats_statistics::durations::competing::{Ending, Outcome};
use mirrorstats_statistics::durations::restricted::{independent, shared_horizon};
use mirrorstats_statistics::intervals::random::SplitMix64;

use crate::{CONFIDENCE, LEVEL, SEED, happens, heading, row, share};

const BUDGET: i64 = 100;

#[derive(Clone, Copy)]
enum Law {
    /// Few late ends.
    Skewed,
    Exponential,
    /// Three different times.
    Ties,
    /// Half of the episodes never end.
    Censored,
}

impl Law {
    #[expect(clippy::cast_possible_truncation, reason = "a number of steps")]
    fn ending(self, random: &mut SplitMix64, is_slow: bool) -> Ending {
        let between = |random: &mut SplitMix64, low: i64, count: f64| low + (random.unit() * count) as i64;
        let steps = match self {
            Self::Skewed if happens(random, if is_slow { 0.6 } else { 0.15 }) => between(random, 60, 19.0),
            Self::Skewed => between(random, 2, 4.0),
            Self::Exponential => 1 + (-(1.0 - random.unit()).ln() * if is_slow { 40.0 } else { 12.0 }) as i64,
            Self::Ties if happens(random, if is_slow { 0.6 } else { 0.1 }) => 40,
            Self::Ties => 5 * between(random, 1, 2.0),
            Self::Censored if happens(random, if is_slow { 0.9 } else { 0.5 }) => BUDGET,
            Self::Censored => between(random, 2, 60.0),
        };
        let outcome = if steps < BUDGET { Outcome::Correct } else { Outcome::Unfinished };
        Ending { steps: steps.min(BUDGET), outcome }
    }
}

pub fn unequal() {
    const STUDIES: usize = 1_000;
    let note = "1,000 studies of two models each: shares with a claim at 0.05, by the studentised permutation test beside Student's t.\n\
                First both models have the same law, so each claim is false; then the model with more episodes is slower, and last\n\
                the one with fewer. Three standard errors above 0.05 are 0.071.";
    let columns = ["law, episodes", "no difference", "more are slower", "fewer are slower"];
    heading("Durations of unequal numbers of episodes", note, &columns);
    let mut random = SplitMix64::seeded(SEED + 6);
    for (name, law) in
        [("skewed", Law::Skewed), ("exponential", Law::Exponential), ("ties", Law::Ties), ("censored", Law::Censored)]
    {
        for [few, many] in [[12, 24], [12, 48], [12, 96], [21, 42]] {
            let mut claims = |slow: [bool; 2]| {
                let claims = (0..STUDIES).filter(|_| {
                    let [first, second] = [(few, slow[0]), (many, slow[1])].map(|(count, is_slow)| {
                        (0..count).map(|_| law.ending(&mut random, is_slow)).collect::<Vec<Ending>>()
                    });
                    let horizon = shared_horizon(&first, &second);
                    let found = horizon.and_then(|horizon| independent(&first, &second, horizon, CONFIDENCE));
                    found.and_then(|found| found.p).is_some_and(|p| p <= LEVEL)
                });
                share(claims.count(), STUDIES)
            };
            let shares = [[false, false], [false, true], [true, false]].map(&mut claims);
            row(&format!("{name}, {few} and {many}"), &shares);
        }
    }
}
