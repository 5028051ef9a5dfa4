//! The rates at which tests and families of tests reject true hypotheses.

use crate::tarone::{Attained, check_mcnemar_least_p, fisher_least_p, mcnemar_least_p, tarone_holm};
use mirrorstats_exact::ratio::Ratio;
use mirrorstats_statistics::chance;
use mirrorstats_statistics::comparisons::holm::holm;
use mirrorstats_statistics::comparisons::paired::Pairs;
use mirrorstats_statistics::comparisons::unpaired::fisher;
use mirrorstats_statistics::intervals::random::SplitMix64;

use crate::{LEVEL, N, SEED, binomial, happens, heading, largest, rates, row, share, successes};

/// By enumeration: the largest rate at which the exact test and its mid-p value reject a true hypothesis.
pub fn sizes() {
    let note = "These are the largest errors, by enumeration. For Fisher's test, they are over rates of 0.01 to 0.50. For McNemar's\n\
                test, they are over shares of discordant pairs of 0.02 to 1. For the binomial test, they are at the level of the test.\n\
                A mid-p value does not keep the level; an exact one does.";
    heading("Exact tests and their mid-p values", note, &["test", "exact", "mid-p"]);
    let error = |p: &dyn Fn(u64, u64) -> f64, rate: f64, n: u64| {
        let weights = binomial(n, rate);
        let each = (0u64..).zip(&weights).flat_map(|(k, a)| (0u64..).zip(&weights).map(move |(l, b)| (k, l, a * b)));
        each.filter(|&(k, l, _)| p(k, l) <= LEVEL).map(|(.., weight)| weight).sum::<f64>()
    };
    let count = |k: u64| usize::try_from(k).expect("a count of episodes");
    for n in [7, N, 50] {
        let tests: Vec<Vec<_>> = (0..=n).map(|k| (0..=n).filter_map(|l| fisher((k, n), (l, n))).collect()).collect();
        let exact = largest(rates().map(|rate| error(&|k, l| tests[count(k)][count(l)].p, rate, n)));
        let mid_p = largest(rates().map(|rate| error(&|k, l| tests[count(k)][count(l)].mid_p, rate, n)));
        row(&format!("Fisher, {n} and {n} episodes"), &[exact, mid_p]);
    }
    for n in [7, N, 50] {
        let of = |d: u64, k: u64| Pairs { both: n - d, first_only: k, second_only: d - k, neither: 0 };
        let error = |p: &dyn Fn(Pairs) -> Option<f64>, rate: f64| {
            let given = |(d, weight): (u64, f64)| {
                let rejected = (0u64..).zip(binomial(d, 0.5)).filter(|(k, _)| p(of(d, *k)).is_some_and(|p| p <= LEVEL));
                weight * rejected.map(|(_, half)| half).sum::<f64>()
            };
            (0u64..).zip(binomial(n, rate)).map(given).sum::<f64>()
        };
        let found = |p: &dyn Fn(Pairs) -> Option<f64>| largest(rates().map(|rate| error(p, 2.0 * rate)));
        row(
            &format!("McNemar, {n} pairs"),
            &[found(&Pairs::mcnemar), found(&|pairs: Pairs| pairs.test().map(|test| test.mid_p))],
        );
    }
    for (n, (above, below)) in [(7, (1, 3)), (N, (1, 3)), (50, (1, 3)), (N, (1, 10))] {
        let level = Ratio::new(above, below).expect("a fraction");
        let weights = binomial(n, level.value());
        let tests = (0u64..).zip(&weights).filter_map(|(k, weight)| Some((chance::exact_test(k, n, level)?, weight)));
        let errors = tests.fold([0.0; 2], |[exact, mid_p], (test, weight)| {
            let of = |p: f64| if p <= LEVEL { *weight } else { 0.0 };
            [exact + of(test.p), mid_p + of(test.mid_p)]
        });
        row(&format!("binomial against {level}, {n} episodes"), &errors);
    }
}

/// One test of a family; true if its hypothesis is true.
type Test = (Attained, bool);

/// Outcomes of 8 models in the same scenes, some of them harder than others.
fn scenes(random: &mut SplitMix64, rates: [f64; 8]) -> Vec<[bool; 8]> {
    let scene = |random: &mut SplitMix64| {
        let is_hard = happens(random, 0.5);
        rates.map(|rate| happens(random, if is_hard { rate * 0.5 } else { rate }))
    };
    (0..N).map(|_| scene(random)).collect()
}

fn every_pair(rates: [f64; 8], mut test: impl FnMut(usize, usize) -> Attained) -> Vec<Test> {
    let pairs = (0..8).flat_map(|a| (a + 1..8).map(move |b| (a, b)));
    pairs.map(|(a, b)| (test(a, b), rates[a].to_bits() == rates[b].to_bits())).collect()
}

fn mcnemar_family(random: &mut SplitMix64, rates: [f64; 8]) -> Vec<Test> {
    let scenes = scenes(random, rates);
    every_pair(rates, |a, b| {
        let count = |of: [bool; 2]| scenes.iter().filter(|scene| [scene[a], scene[b]] == of).count() as u64;
        let [both, first_only, second_only, neither] =
            [[true, true], [true, false], [false, true], [false, false]].map(count);
        let pairs = Pairs { both, first_only, second_only, neither };
        let found = pairs.mcnemar().zip(mcnemar_least_p(pairs));
        found.map(|(p, least)| Attained { p, least }).expect("there are scenes")
    })
}

fn fisher_family(random: &mut SplitMix64, rates: [f64; 8], n: u64) -> Vec<Test> {
    let counts = rates.map(|rate| (successes(random, n, rate), n));
    every_pair(rates, |a, b| {
        let found = fisher(counts[a], counts[b]).zip(fisher_least_p(counts[a], counts[b]));
        found.map(|(test, least)| Attained { p: test.p, least }).expect("there are episodes")
    })
}

/// A conditional metric against 1/3: 8 models with different numbers of episodes.
fn chance_family(random: &mut SplitMix64, rates: [f64; 8]) -> Vec<Test> {
    let third = Ratio::new(1, 3).expect("a fraction");
    let test = |(rate, n): (f64, u64)| {
        let p = chance::two_sided(successes(random, n, rate), n, third).expect("there are episodes");
        let least = chance::least_p(n, third).expect("there are episodes");
        (Attained { p, least }, rate.to_bits() == third.value().to_bits())
    };
    rates.into_iter().zip([1, 2, 3, 3, 5, 9, 15, 21]).map(test).collect()
}

/// The share of studies with a false rejection, and rejections of false hypotheses per study; by Holm, Tarone-Holm.
fn familywise(studies: usize, mut draw: impl FnMut() -> Vec<Test>) -> [f64; 4] {
    let mut found = [0usize; 4];
    for _ in 0..studies {
        let tests = draw();
        let attained: Vec<Attained> = tests.iter().map(|(test, _)| *test).collect();
        let p_values: Vec<f64> = attained.iter().map(|test| test.p).collect();
        for (at, adjusted) in [holm(&p_values), tarone_holm(&attained)].iter().enumerate() {
            let rejected =
                || adjusted.iter().zip(&tests).filter(|(p, _)| **p <= LEVEL).map(|(_, (_, is_true))| *is_true);
            found[at] += usize::from(rejected().any(|is_true| is_true));
            found[at + 2] += rejected().filter(|is_true| !is_true).count();
        }
    }
    found.map(|count| share(count, studies))
}

pub fn families() {
    const STUDIES: usize = 10_000;
    let note = "10,000 studies each: shares with any false rejection, and true differences found per study.";
    let columns = ["family", "error, Holm", "error, Tarone-Holm", "found, Holm", "found, Tarone-Holm"];
    heading("Error of a family of tests", note, &columns);
    check_mcnemar_least_p();
    let mut random = SplitMix64::seeded(SEED + 1);
    let third = 1.0 / 3.0;
    let chance = |random: &mut SplitMix64, high: f64| {
        chance_family(random, [third, high, third, high, third, high, third, high])
    };
    row("8 against chance 1/3, n = 1 to 21, all true", &familywise(STUDIES, || chance(&mut random, third)));
    row("8 against chance 1/3, n = 1 to 21, half true", &familywise(STUDIES, || chance(&mut random, 0.9)));
    for (name, low, high) in [("all 0.5", 0.5, 0.5), ("all 0.95", 0.95, 0.95), ("half 0.5, half 0.95", 0.5, 0.95)] {
        let rates = [low, low, low, low, high, high, high, high];
        let paired = familywise(STUDIES, || mcnemar_family(&mut random, rates));
        row(&format!("28 pairs of models, McNemar, {name}"), &paired);
        let unpaired = familywise(STUDIES, || fisher_family(&mut random, rates, N));
        row(&format!("28 pairs of models, Fisher, {name}"), &unpaired);
        let few = familywise(STUDIES, || fisher_family(&mut random, rates, 7));
        row(&format!("28 pairs of models, Fisher, 7 episodes, {name}"), &few);
    }
}

/// By enumeration: three models compared with each other, for which Tarone-Holm has no proof.
pub fn shared_models() {
    let note = "These are the largest errors over rates 0.01 to 0.50 that three models share, by enumeration. No proof of Tarone-Holm\n\
                exists for comparisons that share a model, so this table is the evidence.";
    heading("Three models, each pair by Fisher's test", note, &["episodes per model", "Holm", "Tarone-Holm"]);
    for n in [4, 5, 6, 7, 9, 12, 15, N] {
        let test = |k: u64, l: u64| {
            let found = fisher((k, n), (l, n)).zip(fisher_least_p((k, n), (l, n)));
            found.map(|(test, least)| Attained { p: test.p, least }).expect("there are episodes")
        };
        let mut rejected = [Vec::new(), Vec::new()];
        for (i, j, k) in (0..=n).flat_map(|i| (0..=n).flat_map(move |j| (0..=n).map(move |k| (i, j, k)))) {
            let tests = [test(i, j), test(i, k), test(j, k)];
            let by_holm = holm(&tests.map(|test| test.p));
            for (rejected, adjusted) in rejected.iter_mut().zip([by_holm, tarone_holm(&tests)]) {
                if adjusted.iter().any(|p| *p <= LEVEL) {
                    rejected.push([i, j, k].map(|count| usize::try_from(count).expect("a count of episodes")));
                }
            }
        }
        let error = |rejected: &Vec<[usize; 3]>| {
            largest(rates().map(|rate| {
                let weights = binomial(n, rate);
                rejected.iter().map(|[i, j, k]| weights[*i] * weights[*j] * weights[*k]).sum()
            }))
        };
        row(&n.to_string(), &[error(&rejected[0]), error(&rejected[1])]);
    }
}
