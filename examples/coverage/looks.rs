//! The error rates of methods with a look after every episode.

use mirrorstats_exact::ratio::Ratio;
use mirrorstats_statistics::chance;
use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::intervals::interval::{Interval, wilson};
use mirrorstats_statistics::intervals::random::SplitMix64;
use mirrorstats_statistics::sequential::{against_level, confidence_sequence, discordant};

use crate::{CONFIDENCE, LEVEL, SEED, happens, heading, row, share, tally};

/// Looks after each episode, up to this many.
const LOOKS: u64 = 200;
const STUDIES: usize = 2_000;

pub fn singles() {
    let note = "2,000 studies each, with a look after each of 200 episodes. The shares are of studies in which the interval contained\n\
                the rate at every look, and in which a test of the true rate ever rejected it. The fixed-n methods are listed for\n\
                comparison.";
    let columns = ["rate", "sequence", "Wilson", "e-value", "exact binomial"];
    heading("A study that is looked at while it runs", note, &columns);
    let mut random = SplitMix64::seeded(SEED + 4);
    for (above, below) in [(1, 20), (1, 10), (1, 3), (1, 2), (9, 10)] {
        let level = Ratio::new(above, below).expect("a fraction");
        let mut found = [0usize; 4];
        for _ in 0..STUDIES {
            let mut k = 0;
            let mut held = [true; 4];
            for n in 1..=LOOKS {
                k += u64::from(happens(&mut random, level.value()));
                let holds =
                    |interval: Option<Interval>| interval.is_some_and(|interval| interval.contains(level.value()));
                held[0] &= holds(confidence_sequence(k, n, CONFIDENCE));
                held[1] &= holds(wilson(k, n, CONFIDENCE));
                held[2] &= against_level(k, n, level).is_some_and(|found| found.p > LEVEL);
                held[3] &= chance::two_sided(k, n, level).is_some_and(|p| p > LEVEL);
            }
            let counted = [held[0], held[1], !held[2], !held[3]];
            tally(&mut found, &counted);
        }
        row(&level.to_string(), &found.map(|count| share(count, STUDIES)));
    }
}

pub fn pairs() {
    let note = "2,000 studies each of 200 pairs, with a look after each pair: shares in which a test ever rejected.";
    heading("Pairs that are looked at while they come", note, &["first only, second only", "e-value", "exact McNemar"]);
    let mut random = SplitMix64::seeded(SEED + 5);
    for (first, second) in [(0.05, 0.05), (0.2, 0.2), (0.4, 0.4), (0.2, 0.05), (0.3, 0.1)] {
        let mut found = [0usize; 2];
        for _ in 0..STUDIES {
            let (mut pairs, mut ever) = (Pairs::default(), [false; 2]);
            for _ in 0..LOOKS {
                match random.unit() {
                    part if part < first => pairs.first_only += 1,
                    part if part < first + second => pairs.second_only += 1,
                    _ => pairs.both += 1,
                }
                ever[0] |= discordant(pairs).is_some_and(|found| found.p <= LEVEL);
                ever[1] |= pairs.mcnemar().is_some_and(|p| p <= LEVEL);
            }
            tally(&mut found, &ever);
        }
        row(&format!("{first}, {second}"), &found.map(|count| share(count, STUDIES)));
    }
}
