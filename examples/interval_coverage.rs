//! The coverage of the intervals of `stats`: simulated and seeded, with the same bytes each time.
//!
//! `cargo run --release --example interval_coverage > benches/COVERAGE-INTERVALS.md` takes about two minutes.

use std::fmt::Write as _;

use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::moments::StandardError::Sample;
use mirrorstats_statistics::comparisons::margin::Counts;
use mirrorstats_statistics::comparisons::units::Sides;
use mirrorstats_statistics::comparisons::unpaired::welch;
use mirrorstats_statistics::durations::competing::{Ending, Incidence, Outcome};
use mirrorstats_statistics::durations::restricted::{independent, paired};
use mirrorstats_statistics::durations::survival::Survival;
use mirrorstats_statistics::intervals::bootstrap;
use mirrorstats_statistics::intervals::clustered::{clustered, clustered_rate};
use mirrorstats_statistics::intervals::interval::{Interval, student_t};

const SEED: u64 = 20_260_115;
const SAMPLES: usize = 4_000;
/// Fewer samples for the bootstrap, because each takes 10,000 resamples.
const BOOTSTRAPPED: usize = 400;
const BUDGET: i64 = 100;
const SIZES: [usize; 12] = [3, 4, 5, 6, 8, 10, 12, 15, 18, 21, 30, 50];
const CLUSTERS: [usize; 9] = [2, 3, 4, 5, 6, 8, 10, 15, 20];
/// The runs per cluster.
const RUNS: usize = 7;

/// The distribution of an episode's steps.
#[derive(Clone, Copy)]
enum Steps {
    /// Any step of the budget with equal chance.
    Even,
    /// The same chance of a decision in each step, with a mean of 10.
    Short,
    /// The same chance of a decision in each step, with a mean of 30.
    Medium,
    /// From step 60 on.
    Late,
    /// Half of the decisions near step 10, half near step 70.
    Two,
}

/// A kind of study: the share of finished episodes, their steps, and the share of correct decisions.
#[derive(Clone, Copy)]
struct Scenario {
    finishing: f64,
    steps: Steps,
    correct: f64,
}

/// The numbers of given intervals and of those that contain the truth.
#[derive(Clone, Copy, Default)]
struct Tally {
    samples: usize,
    given: usize,
    held: usize,
}

/// A generator with a stable stream (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    #[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: i64, high: i64) -> i64 {
        let width = u64::try_from(high - low + 1).expect("low is at most high");
        low + i64::try_from(self.next() % width).expect("less than the width")
    }
}

impl Steps {
    const ALL: [(Self, &str); 5] = [
        (Self::Even, "any step"),
        (Self::Short, "short"),
        (Self::Medium, "medium"),
        (Self::Late, "late"),
        (Self::Two, "two kinds"),
    ];

    fn draw(self, random: &mut Random) -> i64 {
        match self {
            Self::Even => random.between(1, BUDGET),
            Self::Short => geometric(random, 10.0),
            Self::Medium => geometric(random, 30.0),
            Self::Late => random.between(60, BUDGET),
            Self::Two if random.unit() < 0.5 => random.between(5, 15),
            Self::Two => random.between(65, 75),
        }
    }

    /// The chances of the steps from 1 to the budget; the rest to 1 comes later.
    #[expect(clippy::cast_precision_loss, reason = "steps are small")]
    fn chances(self) -> Vec<f64> {
        let even =
            |low: i64, high: i64, t: i64| if (low..=high).contains(&t) { 1.0 / (high - low + 1) as f64 } else { 0.0 };
        let waiting = |mean: f64, t: i64| (1.0 - 1.0 / mean).powi(i32::try_from(t - 1).expect("small")) / mean;
        let chance = |t: i64| match self {
            Self::Even => even(1, BUDGET, t),
            Self::Short => waiting(10.0, t),
            Self::Medium => waiting(30.0, t),
            Self::Late => even(60, BUDGET, t),
            Self::Two => f64::midpoint(even(5, 15, t), even(65, 75, t)),
        };
        (1..=BUDGET).map(chance).collect()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a small number of steps")]
fn geometric(random: &mut Random, mean: f64) -> i64 {
    1 + ((1.0 - random.unit()).ln() / (1.0 - 1.0 / mean).ln()) as i64
}

impl Scenario {
    /// Every distribution with each of these shares of finished episodes; six of ten decisions are correct.
    fn all(finishing: &[f64]) -> Vec<Self> {
        let of = |&finishing: &f64| Steps::ALL.map(|(steps, _)| Self { finishing, steps, correct: 0.6 });
        finishing.iter().flat_map(of).collect()
    }

    fn name(self) -> String {
        let steps = Steps::ALL.iter().find(|(steps, _)| *steps as u8 == self.steps as u8).expect("one of them").1;
        format!("{:.2} finish, {steps}", self.finishing)
    }

    fn draw(self, random: &mut Random) -> Ending {
        let (steps, finishes, correct) = (self.steps.draw(random), random.unit(), random.unit());
        if finishes >= self.finishing || steps > BUDGET {
            return Ending { steps: BUDGET, outcome: Outcome::Unfinished };
        }
        Ending { steps, outcome: if correct < self.correct { Outcome::Correct } else { Outcome::Wrong } }
    }

    fn sample(self, n: usize, random: &mut Random) -> Vec<Ending> {
        (0..n).map(|_| self.draw(random)).collect()
    }

    /// The mean steps to a decision, up to the budget, if `share` of the decisions count.
    #[expect(clippy::cast_precision_loss, reason = "steps are small")]
    fn mean(self, share: f64) -> f64 {
        let chances = self.steps.chances();
        let early: f64 = (1..).zip(&chances).map(|(t, chance)| chance * (BUDGET - t) as f64).sum();
        BUDGET as f64 - self.finishing * share * early
    }

    /// The first step by which half of the episodes have a decision.
    fn median(self) -> Option<i64> {
        let mut decided = 0.0;
        let reached = |chance: f64| {
            decided += self.finishing * chance;
            decided >= 0.5 - 1e-12
        };
        let at = self.steps.chances().into_iter().position(reached)?;
        i64::try_from(at + 1).ok()
    }
}

impl Tally {
    fn count(&mut self, found: Option<Interval>, truth: f64) {
        self.samples += 1;
        // An interval without width is not given.
        if let Some(found) = found.filter(|found| found.low < found.high) {
            self.given += 1;
            self.held += usize::from(found.contains(truth));
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "counts are small")]
    fn coverage(self) -> Option<f64> {
        (self.given * 20 > self.samples).then(|| self.held as f64 / self.given as f64)
    }
}

/// A method: its interval for a sample of n episodes of a scenario, and the truth.
type Method = fn(Scenario, usize, &mut Random) -> (Option<Interval>, Option<f64>);

const LEVEL: f64 = 0.95;

fn moments(sample: &[Ending]) -> Moments {
    sample.iter().fold(Moments::default(), |sum, ending| sum.with(ending.steps).expect("small"))
}

/// Counts every decision as correct.
fn decided(sample: &[Ending]) -> Vec<Ending> {
    let any = |outcome| if outcome == Outcome::Unfinished { outcome } else { Outcome::Correct };
    sample.iter().map(|ending| Ending { outcome: any(ending.outcome), ..*ending }).collect()
}

fn student(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    (student_t(&moments(&scenario.sample(n, random)), Sample, LEVEL), Some(scenario.mean(1.0)))
}

fn bca(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let steps: Vec<i64> = scenario.sample(n, random).iter().map(|ending| ending.steps).collect();
    (bootstrap::mean(&steps, LEVEL), Some(scenario.mean(1.0)))
}

fn restricted_mean(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let curve = Incidence::of(&decided(&scenario.sample(n, random)));
    (curve.and_then(|curve| curve.restricted_mean(BUDGET, LEVEL)?.interval), Some(scenario.mean(1.0)))
}

fn to_correct(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let curve = Incidence::of(&scenario.sample(n, random));
    (curve.and_then(|curve| curve.restricted_mean(BUDGET, LEVEL)?.interval), Some(scenario.mean(scenario.correct)))
}

#[expect(clippy::cast_precision_loss, reason = "steps are small")]
fn median(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let found = Survival::of(&scenario.sample(n, random)).and_then(|curve| curve.median_interval(LEVEL));
    // Bounds at the same step make an interval one step wide.
    let interval = |low: i64, high: Option<i64>| Interval {
        low: low as f64 - 0.5,
        high: high.map_or(f64::INFINITY, |high| high as f64 + 0.5),
    };
    (found.map(|found| interval(found.low, found.high)), scenario.median().map(|median| median as f64))
}

/// A second scenario with a much larger or smaller share of finished episodes.
fn other(scenario: Scenario) -> Scenario {
    let finishing = if scenario.finishing > 0.6 { 1.0 / 3.0 } else { 1.0 };
    Scenario { finishing, ..scenario }
}

fn difference_alike(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let (a, b) = (decided(&scenario.sample(n, random)), decided(&scenario.sample(n, random)));
    (independent(&a, &b, BUDGET, LEVEL).and_then(|found| found.interval), Some(0.0))
}

fn difference_unlike(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let against = other(scenario);
    let (a, b) = (decided(&scenario.sample(n, random)), decided(&against.sample(n, random)));
    let truth = scenario.mean(1.0) - against.mean(1.0);
    (independent(&a, &b, BUDGET, LEVEL).and_then(|found| found.interval), Some(truth))
}

/// Half of the pairs have the same episode on both sides, which gives a correlation of one half.
fn difference_paired(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let first = decided(&scenario.sample(n, random));
    let second = decided(&scenario.sample(n, random));
    let pairs: Vec<(Ending, Ending)> =
        first.into_iter().zip(second).map(|(a, b)| (a, if random.unit() < 0.5 { a } else { b })).collect();
    (paired(&pairs, BUDGET, LEVEL).and_then(|found| found.interval), Some(0.0))
}

fn welch_alike(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let (a, b) = (moments(&scenario.sample(n, random)), moments(&scenario.sample(n, random)));
    (welch(&a, &b, LEVEL), Some(0.0))
}

fn welch_unlike(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let against = other(scenario);
    let (a, b) = (moments(&scenario.sample(n, random)), moments(&against.sample(n, random)));
    (welch(&a, &b, LEVEL), Some(scenario.mean(1.0) - against.mean(1.0)))
}

/// Steps, if all runs of a cluster share the decision to finish with a probability of 0.3.
fn by_cluster(scenario: Scenario, clusters: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let of_cluster = |random: &mut Random| {
        let (together, all) = (random.unit() < 0.3, random.unit() < scenario.finishing);
        let forced = Scenario { finishing: if all { 1.0 } else { 0.0 }, ..scenario };
        moments(&(if together { forced } else { scenario }).sample(RUNS, random))
    };
    let parts: Vec<Moments> = (0..clusters).map(|_| of_cluster(random)).collect();
    (clustered(&parts, LEVEL).and_then(|found| found.interval), Some(scenario.mean(1.0)))
}

/// The rate of finished episodes, with the same dependence.
fn rate_by_cluster(scenario: Scenario, clusters: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    let rate = scenario.finishing.min(0.8);
    let of_cluster = |random: &mut Random| {
        let (together, all) = (random.unit() < 0.3, random.unit() < rate);
        let own = match (together, all) {
            (false, _) => rate,
            (true, all) => f64::from(u8::from(all)),
        };
        (0..RUNS).fold(Moments::default(), |sum, _| sum.with((random.unit() < own).into()).expect("small"))
    };
    let parts: Vec<Moments> = (0..clusters).map(|_| of_cluster(random)).collect();
    (clustered_rate(&parts, LEVEL).and_then(|found| found.interval), Some(rate))
}

/// A share of finished episodes that some episode misses.
fn rate_of(scenario: Scenario) -> f64 {
    scenario.finishing.min(0.95)
}

/// Units of 1 to 3 episodes. An episode copies the first one of its unit with probability 1/2; that copies `shared`.
fn unit(rate: f64, shared: Option<bool>, random: &mut Random) -> (bool, Moments) {
    let mut draw = |copied: Option<bool>| {
        let (own, copies) = (random.unit() < rate, random.unit() < 0.5);
        copied.filter(|_| copies).unwrap_or(own)
    };
    let first = draw(shared);
    let both = [draw(Some(first)), draw(Some(first))];
    let more = usize::try_from(random.between(0, 2)).expect("at most two");
    let all = [first].into_iter().chain(both.into_iter().take(more));
    (first, all.fold(Moments::default(), |sum, one| sum.with(one.into()).expect("small")))
}

fn rates_of_units(
    [first, second]: [Scenario; 2],
    [shared, a, b]: [usize; 3],
    random: &mut Random,
) -> (Option<Interval>, Option<f64>) {
    let rates = [first, second].map(rate_of);
    let pair = |random: &mut Random| {
        let (verdict, one) = unit(rates[0], None, random);
        // A copied verdict has the other side's rate only if both rates are equal.
        let copied = (rates[0] - rates[1]).abs() < 1e-9;
        (one, unit(rates[1], copied.then_some(verdict), random).1)
    };
    let shared = (0..shared).map(|_| pair(random)).collect();
    let mut side = |rate, n| (0..n).map(|_| unit(rate, None, random).1).collect();
    let units = Sides { shared, first: side(rates[0], a), second: side(rates[1], b) };
    (Counts::of_units(&units).interval(LEVEL), Some(rates[0] - rates[1]))
}

fn shared_alike(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    rates_of_units([scenario; 2], [n, 0, 0], random)
}

fn shared_unlike(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    rates_of_units([scenario, other(scenario)], [n, 0, 0], random)
}

fn apart_alike(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    rates_of_units([scenario; 2], [0, n, n], random)
}

fn apart_unequal(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    rates_of_units([scenario, other(scenario)], [0, n, 4 * n], random)
}

fn half_shared(scenario: Scenario, n: usize, random: &mut Random) -> (Option<Interval>, Option<f64>) {
    rates_of_units([scenario, other(scenario)], [n / 2, n - n / 2, n], random)
}

/// The coverage of a method in one scenario.
fn tally(method: Method, scenario: Scenario, n: usize, samples: usize) -> Tally {
    let mut random = Random(SEED ^ n as u64);
    let mut tally = Tally::default();
    for _ in 0..samples {
        if let (found, Some(truth)) = method(scenario, n, &mut random) {
            tally.count(found, truth);
        }
    }
    tally
}

/// One row per method: the lowest coverage over all scenarios at each size.
fn rows(text: &mut String, methods: &[(&str, Method, usize)], sizes: &[usize], scenarios: &[Scenario]) {
    let names = sizes.iter().map(ToString::to_string).collect::<Vec<_>>().join(" | ");
    let shown = sizes.len().saturating_sub(2);
    let _ = writeln!(text, "| method | {names} | worst scenario at {} |", sizes[shown]);
    let _ = writeln!(text, "|---|{}---|", "---:|".repeat(sizes.len()));
    for (name, method, samples) in methods {
        let mut cells = Vec::new();
        let mut worst_names = Vec::new();
        for &n in sizes {
            let found = scenarios.iter().filter_map(|&s| Some((tally(*method, s, n, *samples).coverage()?, s)));
            let worst = found.min_by(|a, b| a.0.total_cmp(&b.0));
            cells.push(worst.map_or("--".to_owned(), |(coverage, _)| format!("{coverage:.3}")));
            worst_names.push(worst.map_or("--".to_owned(), |(_, scenario)| scenario.name()));
        }
        let _ = writeln!(text, "| {name} | {} | {} |", cells.join(" | "), worst_names[shown]);
    }
}

fn main() {
    let mut text = format!(
        "# How often the intervals of `stats` hold the truth\n\n\
         Written by `cargo run --release --example interval_coverage > benches/COVERAGE-INTERVALS.md`, seed {SEED}: the same\n\
         bytes each time. Intervals of 95 %; {SAMPLES} samples per scenario and size ({BOOTSTRAPPED} for the bootstrap), so that a coverage of\n\
         0.90 is known to 0.005 (0.015). The tables show the lowest coverage of each method over all scenarios. They use only\n\
         samples for which the method gives an interval that is wider than a point; `--` means that it hardly ever does.\n\n\
         In a scenario, a third, half, two thirds or all of the episodes finish. They finish after any step of the budget of\n\
         {BUDGET}. They do so mostly early (waiting times with a mean of 10 or 30), late (from step 60 on), or in two groups (near\n\
         10, near 70). Six of ten decisions are correct. The other episodes run to the budget and are censored there.\n\n## By episodes\n\n"
    );
    let usual = Scenario::all(&[1.0 / 3.0, 0.5, 2.0 / 3.0, 1.0]);
    let methods: [(&str, Method, usize); 10] = [
        ("Student's t of the mean", student, SAMPLES),
        ("BCa bootstrap of the mean", bca, BOOTSTRAPPED),
        ("restricted mean", restricted_mean, SAMPLES),
        ("restricted mean to a correct decision", to_correct, SAMPLES),
        ("median (Brookmeyer and Crowley)", median, SAMPLES),
        ("difference of restricted means, alike", difference_alike, SAMPLES),
        ("difference of restricted means, unlike", difference_unlike, SAMPLES),
        ("difference of restricted means, pairs", difference_paired, SAMPLES),
        ("Welch's t, alike", welch_alike, SAMPLES),
        ("Welch's t, unlike", welch_unlike, SAMPLES),
    ];
    rows(&mut text, &methods, &SIZES, &usual);
    text.push_str("\nn is the number of episodes; for differences, it is the number on each side. Unlike: a third of the episodes of one\n\
         side and all episodes of the other side finish. Pairs: every second pair has the same episode twice.\n\n## By clusters of seven runs\n\n");
    let clustered: [(&str, Method, usize); 2] =
        [("steps, t(clusters - 1)", by_cluster, SAMPLES), ("a rate, t(clusters - 1)", rate_by_cluster, SAMPLES)];
    rows(&mut text, &clustered, &CLUSTERS, &usual);
    text.push_str(
        "\nIn three of ten clusters, all episodes finish or none does. n is the number of clusters.\n\n\
         ## Differences of rates by unit\n\nScore intervals (Tango; Mee) over n units of 1 to 3 episodes, which copy the first one of their unit in half of the cases.\n\
         Alike: both sides have the same rate. Unlike: 1/3 against 0.95.\n\n",
    );
    let by_unit: [(&str, Method, usize); 5] = [
        ("shared units, alike", shared_alike, SAMPLES),
        ("shared units, unlike", shared_unlike, SAMPLES),
        ("units of one side, alike", apart_alike, SAMPLES),
        ("units of one side, n against 4 n, unlike", apart_unequal, SAMPLES),
        ("half of them shared, unlike", half_shared, SAMPLES),
    ];
    let rates: Vec<Scenario> = usual.iter().copied().filter(|it| matches!(it.steps, Steps::Even)).collect();
    rows(&mut text, &by_unit, &SIZES[2..], &rates);
    text.push_str(
        "\nn is the number of units on the smaller side.\n\n\
         ## Where one outcome is rare\n\nOne in ten or a quarter of the episodes finishes, or one in ten does not. No rule over n can fix this: a sample\n\
         without the rare outcome cannot show that the outcome exists.\n\n",
    );
    let rare = Scenario::all(&[0.1, 0.25, 0.9]);
    let few: [(&str, Method, usize); 3] = [methods[0], methods[2], methods[6]];
    rows(&mut text, &few, &[15, 21, 30, 50, 100], &rare);
    print!("{text}");
}
