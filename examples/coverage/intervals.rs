//! The coverage of intervals over several experiments.

use mirrorstats_statistics::comparisons::improvement::probability_of_improvement;
use mirrorstats_statistics::comparisons::stratified::{Stratum, common_difference, exact};
use mirrorstats_statistics::intervals::interval::Interval;
use mirrorstats_statistics::intervals::random::SplitMix64;

use crate::{CONFIDENCE, LEVEL, SEED, heading, row, share, successes, tally};

/// The chi-squared statistic with 1 degree of freedom whose p value is [`LEVEL`].
const CRITICAL: f64 = 3.841_458_820_694_124;

/// The statistic of the test of no difference in any stratum, without and with a continuity correction of 1/2, which
/// never makes it negative (Cochran 1954; Mantel and Haenszel 1959). `None` if no stratum has both a success and a
/// failure. Every stratum has episodes of both sides.
#[expect(clippy::cast_precision_loss, reason = "counts of episodes")]
fn cochran_mantel_haenszel(strata: &[Stratum]) -> Option<[f64; 2]> {
    let (mut excess, mut variance) = (0.0, 0.0);
    for Stratum { first, second } in strata {
        let [x, m, y, n] = [first.0, first.1, second.0, second.1].map(|count| count as f64);
        let (all, successes) = (m + n, x + y);
        excess += (x * n - y * m) / all;
        variance += m * n * successes * (all - successes) / (all * all * (all - 1.0));
    }
    let statistic = |excess: f64| excess * excess / variance;
    (variance > 0.0).then(|| [statistic(excess.abs()), statistic((excess.abs() - 0.5).max(0.0))])
}

/// statsmodels 0.15.0: `StratifiedTable(tables).test_null_odds(correction)`. The third are the admissions at Berkeley in
/// 1973, from R's `UCBAdmissions`.
fn check_cochran_mantel_haenszel() {
    type Counts = ((u64, u64), (u64, u64));
    let known: [(&[Counts], [f64; 2]); 4] = [
        (
            &[((15, 21), (9, 21)), ((12, 21), (8, 20)), ((18, 21), (14, 19))],
            [5.145_414_138_110_284, 4.317_784_713_811_399],
        ),
        (
            &[((1, 2), (0, 3)), ((2, 2), (1, 4)), ((0, 1), (0, 2)), ((3, 4), (1, 3))],
            [4.740_606_936_416_186, 2.913_475_433_526_012_5],
        ),
        (
            &[
                ((512, 825), (89, 108)),
                ((353, 560), (17, 25)),
                ((120, 325), (202, 593)),
                ((138, 417), (131, 375)),
                ((53, 191), (94, 393)),
                ((22, 373), (24, 341)),
            ],
            [1.524_606_660_443_435_6, 1.426_946_228_586_688_3],
        ),
        (&[((21, 21), (0, 21)), ((7, 7), (0, 9))], [55.993_227_990_970_65, 52.182_066_204_962_05]),
    ];
    for (counts, expected) in known {
        let strata: Vec<Stratum> = counts.iter().map(|&(first, second)| Stratum { first, second }).collect();
        let found = cochran_mantel_haenszel(&strata).expect("each has successes and failures");
        let is_close = found.iter().zip(expected).all(|(found, expected)| (found / expected - 1.0).abs() < 1e-9);
        assert!(is_close, "{counts:?}: {found:?}");
    }
}

pub fn common_differences() {
    const STUDIES: usize = 20_000;
    let note = "20,000 studies each of three experiments with rates 0.2, 0.5, 0.7 of the second side and the same difference. `none`\n\
                is the share without an interval, and coverage is that of the others; errors and powers are those of the\n\
                Cochran-Mantel-Haenszel tests.";
    let columns = ["episodes; difference", "coverage", "none", "CMH", "corrected", "exact", "mid-p"];
    heading("Mantel-Haenszel difference", note, &columns);
    check_cochran_mantel_haenszel();
    let mut random = SplitMix64::seeded(SEED + 2);
    for sizes in [[(21, 21); 3], [(7, 7); 3], [(3, 3); 3], [(7, 21), (21, 7), (14, 14)]] {
        for difference in [0.0, 0.2, 0.3] {
            let mut found = [0usize; 6];
            for _ in 0..STUDIES {
                let draw = |((m, n), rate): ((u64, u64), f64)| Stratum {
                    first: (successes(&mut random, m, rate + difference), m),
                    second: (successes(&mut random, n, rate), n),
                };
                let strata: Vec<Stratum> = sizes.into_iter().zip([0.2, 0.5, 0.7]).map(draw).collect();
                let interval = common_difference(&strata, CONFIDENCE).and_then(|common| common.interval);
                let (cmh, test) = (cochran_mantel_haenszel(&strata), exact(&strata));
                let is_shown = |p: Option<f64>| p.is_some_and(|p| p <= LEVEL);
                let counted = [
                    interval.is_some_and(|interval| interval.contains(difference)),
                    interval.is_none(),
                    cmh.is_some_and(|[plain, _]| plain >= CRITICAL),
                    cmh.is_some_and(|[_, corrected]| corrected >= CRITICAL),
                    is_shown(test.map(|test| test.p)),
                    is_shown(test.map(|test| test.mid_p)),
                ];
                tally(&mut found, &counted);
            }
            let mut numbers = found.map(|count| share(count, STUDIES));
            numbers[0] = share(found[0], STUDIES - found[1]);
            row(&format!("{}; {difference}", sizes.map(|(m, n)| format!("{m}+{n}")).join(", ")), &numbers);
        }
    }
}

/// The values of one side in an episode, with their probabilities.
type Distribution = Vec<(i64, f64)>;

fn rate(of: f64) -> Distribution {
    vec![(0, 1.0 - of), (1, of)]
}

/// Steps to a decision with the same probability in each step, at most 100.
fn steps(at_each: f64) -> Distribution {
    let mut left = 1.0;
    let mut each = |t| {
        let now = if t == 100 { left } else { left * at_each };
        left -= now;
        (t, now)
    };
    (1..=100).map(&mut each).collect()
}

fn drawn(random: &mut SplitMix64, n: usize, from: &Distribution) -> Vec<i64> {
    let one = |random: &mut SplitMix64| {
        let mut left = random.unit();
        let last = from.last().map_or(0, |(value, _)| *value);
        from.iter()
            .find(|(_, weight)| {
                left -= weight;
                left < 0.0
            })
            .map_or(last, |(value, _)| *value)
    };
    (0..n).map(|_| one(random)).collect()
}

fn improvement(first: &Distribution, second: &Distribution) -> f64 {
    let half = |x: i64, y: i64| f64::from(i8::from(x > y) + i8::from(x >= y)) / 2.0;
    first.iter().flat_map(|(x, a)| second.iter().map(move |(y, b)| a * b * half(*x, *y))).sum()
}

pub fn improvements() {
    const STUDIES: usize = 400;
    let note = "400 studies each of three experiments. With fewer than 50 values per side there is no interval.";
    heading(
        "Probability of improvement, percentile bootstrap",
        note,
        &["values; per side and experiment", "truth", "coverage"],
    );
    let mut random = SplitMix64::seeded(SEED + 3);
    for (name, first, second) in [
        ("rates 0.5 and 0.5", rate(0.5), rate(0.5)),
        ("rates 0.9 and 0.6", rate(0.9), rate(0.6)),
        ("rates 0.95 and 0.9", rate(0.95), rate(0.9)),
        ("steps, 0.05 and 0.05 at each", steps(0.05), steps(0.05)),
        ("steps, 0.01 and 0.05 at each", steps(0.01), steps(0.05)),
    ] {
        let truth = improvement(&first, &second);
        for n in [17, 21, 42] {
            let mut study = || -> Option<Interval> {
                let sides: Vec<_> =
                    (0..3).map(|_| (drawn(&mut random, n, &first), drawn(&mut random, n, &second))).collect();
                let strata: Vec<_> = sides.iter().map(|(first, second)| (&first[..], &second[..])).collect();
                probability_of_improvement(&strata, CONFIDENCE)?.interval
            };
            let intervals: Vec<Interval> = (0..STUDIES).filter_map(|_| study()).collect();
            let covered = intervals.iter().filter(|interval| interval.contains(truth)).count();
            row(&format!("{name}; {n}"), &[truth, share(covered, intervals.len())]);
        }
    }
}
