//! False claims of `stats` about models that do not differ: whole families of tests, run through the command.
//!
//! `cargo build --release && cargo run --release --example family_errors -- target/release/mirrorstats >
//! benches/COVERAGE-FAMILIES.md`; seeded, the same bytes on every machine. Each study is a file of scores.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

use mirrorstats_analysis::statistics::{Comparison, Statistics, Verdict};
use mirrorstats_statistics::comparisons::holm::holm;
use mirrorstats_statistics::comparisons::unpaired::fisher;
use mirrorstats_statistics::durations::competing::{Ending, Outcome};
use mirrorstats_statistics::durations::restricted::{independent, paired};
use mirrorstats_statistics::intervals::random::SplitMix64;

const SEED: u64 = 20_260_131;
const LEVEL: f64 = 0.05;
const STUDIES: usize = 100;
/// Each experiment of a study is its own family.
const EXPERIMENTS: usize = 4;
const MODELS: usize = 8;
const BUDGET: i64 = 100;
const SIZES: [usize; 6] = [3, 5, 7, 12, 21, 60];

/// The design of a study's episodes.
#[derive(Clone, Copy)]
struct Design {
    scenes: usize,
    repeats: usize,
    /// True if models share their scenes.
    paired: bool,
    copied: f64,
    /// The chance of a decision at each step.
    deciding: f64,
    /// True if half of the models succeed in 0.9 of the episodes and decide four times as fast.
    differing: bool,
}

/// The result of an episode.
#[derive(Clone, Copy)]
struct Episode {
    solved: bool,
    steps: i64,
}

/// The episodes of one experiment, by model, then by scene.
type Drawn = Vec<Vec<Episode>>;

fn main() {
    let program = std::env::args().nth(1).map_or_else(|| PathBuf::from("target/release/mirrorstats"), PathBuf::from);
    println!("{}", INTRODUCTION.trim());
    let base = Design { scenes: 0, repeats: 1, paired: true, copied: 0.0, deciding: 0.02, differing: false };
    let sized = |design: Design| SIZES.map(|scenes| Design { scenes, ..design }).to_vec();
    let few = |design: Design| sized(design)[..5].to_vec();
    let repeated = |copied: f64, differing: bool| {
        let of = |(scenes, repeats)| Design { scenes, repeats, copied, differing, ..base };
        [(3, 3), (3, 7), (5, 3), (7, 3), (12, 3), (21, 2)].map(of).to_vec()
    };
    let apart = Design { paired: false, ..base };
    for (title, designs) in [
        ("Pairs, no difference", sized(base)),
        ("Pairs that share half of what happens, no difference", sized(Design { copied: 0.5, ..base })),
        ("Pairs that decide early, no difference", few(Design { deciding: 0.2, ..base })),
        ("No pairs, no difference", sized(apart)),
        ("No pairs, early decisions, no difference", few(Design { deciding: 0.2, ..apart })),
        ("Repeats that all copy the first, no difference", repeated(1.0, false)),
        ("Repeats of which 0.45 copy the first, no difference", repeated(0.45, false)),
        ("Pairs, half of the models better", few(Design { differing: true, ..base })),
        ("No pairs, half of the models better", few(Design { differing: true, ..apart })),
        ("Repeats of which 0.45 copy the first, half of the models better", repeated(0.45, true)),
    ] {
        let columns = ["chance", "models", "rejected", "durations", "rejected", "E1 - E2", "durations", "overall"];
        println!("\n## {title}\n\n| scenes | {} |\n|{}", columns.join(" | "), " --- |".repeat(columns.len() + 1));
        for design in designs {
            let shares = shares(&program, design);
            println!("| {} | {} |", design.name(), shares.join(" | "));
        }
    }
}

const INTRODUCTION: &str = "
# Errors of whole families, through the command

`cargo build --release && cargo run --release --example family_errors -- target/release/mirrorstats >
benches/COVERAGE-FAMILIES.md`, seed 20260131. Each study is a file of scores of 8 models in E1 to E4, given to
`mirrorstats stats FILE --json`. A number is the share of families in which `stats` claims anything after Holm at
level 0.05. If half of the models are better, the first number is the share of families in which it finds a true
difference. The number after the slash is the share in which it claims a false one. Each row has 100 studies. They
give 400 families each for rates against chance 1/3 and for 28 pairs of models under TSA and under TTD. They give 100
families each for E1 - E2 over 8 models and for 28 pairs over all experiments. Three standard errors above 0.05 are
0.083 for 400 families and 0.115 for 100.

The tables also list the rejected methods. For rates, these are mid-p values, or Fisher's test of all episodes if
scenes are repeated. For restricted means, it is the normal test of all episodes. Quantities have no test, so there is
no claim about them.
";

impl Design {
    fn name(self) -> String {
        if self.repeats == 1 { self.scenes.to_string() } else { format!("{} x {}", self.scenes, self.repeats) }
    }

    const fn is_better(self, model: usize) -> bool {
        self.differing && model >= MODELS / 2
    }

    fn episode(self, random: &mut SplitMix64, model: usize) -> Episode {
        let (rate, deciding) =
            if self.is_better(model) { (0.9, 4.0 * self.deciding) } else { (1.0 / 3.0, self.deciding) };
        let solved = random.unit() < rate;
        let steps = (1..BUDGET).find(|_| random.unit() < deciding).unwrap_or(BUDGET);
        Episode { solved, steps }
    }

    fn draw(self, random: &mut SplitMix64) -> Drawn {
        let shared: Vec<Episode> = (0..self.scenes).map(|_| self.episode(random, 0)).collect();
        let mut scene = |model: usize, scene: usize| -> Vec<Episode> {
            let first = if self.repeats > 1 { self.episode(random, model) } else { shared[scene] };
            let mut one = || if random.unit() < self.copied { first } else { self.episode(random, model) };
            (0..self.repeats).map(|_| one()).collect()
        };
        (0..MODELS).map(|model| (0..self.scenes).flat_map(|at| scene(model, at)).collect()).collect()
    }

    fn csv(self, study: &[Drawn]) -> String {
        let mut text = "episode_id,model,experiment,seed,run,scene,TSA,TTD,TSA-C\n".to_owned();
        for (experiment, models) in (1..).zip(study) {
            for (model, episodes) in models.iter().enumerate() {
                for (run, &Episode { solved, steps }) in episodes.iter().enumerate() {
                    let scene = run / self.repeats;
                    let own = if self.paired { String::new() } else { format!("m{model}-") };
                    let solved = u8::from(solved);
                    let completed = if steps < BUDGET { solved.to_string() } else { String::new() };
                    let key = format!("E{experiment}-m{model}-{run},m{model},E{experiment},1,{run},{own}{scene}");
                    let _ = writeln!(text, "{key},{solved},{steps},{completed}");
                }
            }
        }
        text
    }
}

/// The true and the false claims of a family.
#[derive(Clone, Copy, Default)]
struct Claims {
    right: bool,
    wrong: bool,
}

impl Claims {
    fn add(&mut self, is_claimed: bool, is_true: bool) {
        self.right |= is_claimed && is_true;
        self.wrong |= is_claimed && !is_true;
    }
}

/// The families of one study, in the columns of the table.
type Columns = [Vec<Claims>; 8];

fn shares(program: &Path, design: Design) -> Vec<String> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut columns = Columns::default();
        loop {
            let study = next.fetch_add(1, Ordering::Relaxed);
            if study >= STUDIES {
                return columns;
            }
            for (all, more) in columns.iter_mut().zip(claims(program, design, study)) {
                all.extend(more);
            }
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let parts: Vec<Columns> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().map(|worker| worker.join().expect("a study is simulated")).collect()
    });
    let share = |at: usize, is_claim: fn(&Claims) -> bool| {
        let families = || parts.iter().flat_map(|columns| &columns[at]);
        crate::share(families().filter(|claims| is_claim(claims)).count(), families().count())
    };
    let text = |at| match (share(at, |it| it.right), share(at, |it| it.wrong)) {
        (right, wrong) if design.differing => format!("{right:.3} / {wrong:.3}"),
        (_, wrong) => format!("{wrong:.4}"),
    };
    (0..8).map(text).collect()
}

#[expect(clippy::cast_precision_loss, reason = "counts of a simulation")]
fn share(count: usize, of: usize) -> f64 {
    count as f64 / of as f64
}

fn claims(program: &Path, design: Design, study: usize) -> Columns {
    let mut random = SplitMix64::seeded(SEED + study as u64);
    let drawn: Vec<Drawn> = (0..EXPERIMENTS).map(|_| design.draw(&mut random)).collect();
    let found = statistics_of(program, &design.csv(&drawn));
    let is_true = |first: &str, second: &str| design.is_better(number(first)) != design.is_better(number(second));
    let mut columns = Columns::default();
    for experiment in found.chance.chunk_by(|a, b| (&a.key.experiment, &a.metric) == (&b.key.experiment, &b.metric)) {
        let mut claims = Claims::default();
        for row in experiment {
            claims.add(row.verdict != Verdict::NotSeparated, design.is_better(number(&row.key.model)));
        }
        if experiment[0].metric == "TSA" {
            columns[0].push(claims);
        }
    }
    for (family, column) in found.models.iter().filter_map(|family| Some((family, column_of(&family.metric, [1, 3])?)))
    {
        let mut claims = Claims::default();
        for test in &family.tests {
            claims.add(test.comparison.separated, is_true(&test.first, &test.second));
        }
        columns[column].push(claims);
        let drawn = &drawn[family.experiment[1..].parse::<usize>().expect("E1 to E4") - 1];
        let pairs: Vec<[usize; 2]> =
            family.tests.iter().map(|test| [&test.first, &test.second].map(|name| number(name))).collect();
        let given_up: Vec<f64> = if column == 1 {
            let mid_p =
                |(test, pair): (&Comparison, &[usize; 2])| test.mid_p.unwrap_or_else(|| by_episode(drawn, *pair));
            family.tests.iter().map(|test| &test.comparison).zip(&pairs).map(mid_p).collect()
        } else {
            pairs.iter().map(|pair| normal_test(drawn, *pair, design.paired)).collect()
        };
        let mut claims = Claims::default();
        for ([a, b], p) in pairs.iter().zip(holm(&given_up)) {
            claims.add(p <= LEVEL, design.is_better(*a) != design.is_better(*b));
        }
        columns[column + 1].push(claims);
    }
    for (metric, column) in [("TSA", 5), ("TTD", 6)] {
        let mut claims = Claims::default();
        let of_family = found.conditions.iter().filter(|it| it.metric == metric && it.against == "E2");
        of_family.for_each(|contrast| claims.add(contrast.comparison.separated, false));
        columns[column].push(claims);
    }
    let mut claims = Claims::default();
    let overall = found.overall.iter().filter(|row| row.metric == "TSA");
    overall.for_each(|row| claims.add(row.separated, is_true(&row.first, &row.second)));
    columns[7].push(claims);
    columns
}

fn column_of(metric: &str, [rate, duration]: [usize; 2]) -> Option<usize> {
    match metric {
        "TSA" => Some(rate),
        "TTD" => Some(duration),
        _ => None,
    }
}

fn number(model: &str) -> usize {
    model[1..].parse().expect("a model is m0 to m7")
}

fn statistics_of(program: &Path, csv: &str) -> Statistics {
    let file = tempfile::Builder::new().suffix(".csv").tempfile().expect("a temporary file");
    std::fs::write(file.path(), csv).expect("a temporary file");
    let output = Command::new(program).arg("stats").arg(file.path()).arg("--json").output();
    let output = output.unwrap_or_else(|error| panic!("{}: {error}", program.display()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("statistics as JSON")
}

fn by_episode(drawn: &Drawn, pair: [usize; 2]) -> f64 {
    let [first, second] = pair.map(|model| {
        let successes = drawn[model].iter().filter(|episode| episode.solved).count();
        (successes as u64, drawn[model].len() as u64)
    });
    fisher(first, second).expect("there are episodes").p
}

/// The two-sided p value of the normal test of restricted means, which `stats` used from 12 episodes on.
fn normal_test(drawn: &Drawn, pair: [usize; 2], is_paired: bool) -> f64 {
    let ending = |episode: &Episode| {
        let outcome = if episode.steps < BUDGET { Outcome::Correct } else { Outcome::Unfinished };
        Ending { steps: episode.steps, outcome }
    };
    let [first, second] = pair.map(|model| drawn[model].iter().map(ending).collect::<Vec<_>>());
    if first.len() < 12 {
        return 1.0;
    }
    let pairs: Vec<_> = first.iter().copied().zip(second.iter().copied()).collect();
    let horizon = [&first, &second].map(|side| side.iter().map(|ending| ending.steps).max().unwrap_or(0));
    let horizon = horizon[0].min(horizon[1]);
    let found = if is_paired { paired(&pairs, horizon, 0.95) } else { independent(&first, &second, horizon, 0.95) };
    found.filter(|found| found.p.is_some()).map_or(1.0, |found| normal_beyond((found.difference / found.se).abs()))
}

/// Twice the upper tail of the normal distribution, by Simpson's rule over ten deviations.
fn normal_beyond(z: f64) -> f64 {
    const STEPS: i32 = 400;
    let density = |x: f64| (-x * x / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let step = 10.0 / f64::from(STEPS);
    let weight = |at: i32| if at == 0 || at == STEPS { 1.0 } else { f64::from(2 + 2 * (at % 2)) };
    2.0 * (0..=STEPS).map(|at| weight(at) * density(z + f64::from(at) * step)).sum::<f64>() * step / 3.0
}
