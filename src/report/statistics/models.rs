//! Models against each other in one experiment: paired by seed and run, and sets of ties instead of ranks.

use std::cmp::Ordering;
use std::ops::Range;

use arrow::buffer::BooleanBuffer;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Block, Places, Study};
use crate::metric::catalog::Better;
use crate::score::table::MetricColumn;
use crate::stats::holm::{holm, level};
use crate::stats::interval::Interval;
use crate::stats::letter_display::tied_sets;
use crate::stats::paired::Pairs;
use crate::stats::power::{Detectable, detectable};

/// All comparisons of models under one rate in one experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Family {
    /// The experiment.
    pub experiment: String,
    /// The metric, a rate.
    pub metric: String,
    /// The models, best mean first; by name where means are equal.
    pub models: Vec<String>,
    /// Sets of models that no adjusted test tells apart, each as large as can be; they may overlap.
    pub tied: Vec<Vec<String>>,
    /// Every pair of models, in the order of `models`.
    pub tests: Vec<PairTest>,
    /// What this many pairs could have shown.
    pub detectable: Reach,
}

/// The smallest differences that could have been shown; none where no outcome would have been enough.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reach {
    /// The most pairs that any two models share.
    pub n: u64,
    /// The number of tests in the family.
    pub tests: usize,
    /// In a single test.
    pub single: Option<Detectable>,
    /// In the first step of Holm's procedure over the family.
    pub family: Option<Detectable>,
}

/// One model against another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PairTest {
    /// The model with the better mean.
    pub first: String,
    /// The other one.
    pub second: String,
    /// The 2x2 table of the pairs.
    pub pairs: Pairs,
    /// The number of pairs.
    pub n: u64,
    /// Seeds and runs that only one of the two has, or that one has more than once.
    pub missing: u64,
    /// Pairs left out because the metric is undefined in one episode or both.
    pub undefined: u64,
    /// The first rate minus the second, over the pairs.
    pub difference: Option<f64>,
    /// Its interval, not adjusted for the number of comparisons.
    pub interval: Option<Interval>,
    /// The exact p value; none without a pair.
    pub p: Option<f64>,
    /// The same adjusted by Holm's method over all pairs of models in the experiment.
    pub p_adjusted: Option<f64>,
    /// Whether the adjusted value reaches the level of significance.
    pub separated: bool,
}

/// A seed and run that some models of an experiment have and this one has not, or has more than once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Gap {
    /// The experiment.
    pub experiment: String,
    /// The model.
    pub model: String,
    /// The seed.
    pub seed: i32,
    /// The run.
    pub run: i32,
    /// How many episodes there are instead of one.
    pub episodes: usize,
}

/// A model in an experiment, its episodes by seed and run.
struct Entrant<'a> {
    model: &'a str,
    mean: Option<f64>,
    outcomes: Outcomes,
}

/// One bit per seed and run of the experiment.
struct Outcomes {
    /// Whether there is an episode, or several.
    present: BooleanBuffer,
    /// Whether there is exactly one.
    single: BooleanBuffer,
    /// Whether there is exactly one, and the metric is defined in it.
    defined: BooleanBuffer,
    /// Whether it is 1 then.
    one: BooleanBuffer,
}

impl Family {
    /// Every rate in every experiment with at least two models.
    pub(super) fn all(study: &Study, confidence: f64) -> Vec<Self> {
        let mut families = Vec::new();
        for experiment in study.experiments.iter().filter(|experiment| experiment.blocks.len() > 1) {
            let places = Places::of(&experiment.blocks, study.table);
            for column in study.rates() {
                let entrants = entrants(study, &experiment.blocks, &places, column);
                families.push(Self::of(experiment.name, column, &entrants, confidence));
            }
        }
        families
    }

    fn of(experiment: &str, column: &MetricColumn, entrants: &[Entrant], confidence: f64) -> Self {
        let mut tests = Vec::new();
        for (at, first) in entrants.iter().enumerate() {
            tests.extend(entrants[at + 1..].iter().map(|second| PairTest::of(first, second, confidence)));
        }
        adjust(&mut tests, confidence);
        let models: Vec<String> = entrants.iter().map(|entrant| entrant.model.to_owned()).collect();
        let count = models.len();
        // Pairs are listed row by row of the upper triangle.
        let index = |a: usize, b: usize| a * (2 * count - a - 1) / 2 + (b - a - 1);
        let tied = tied_sets(count, |a, b| tests[index(a, b)].separated);
        Self {
            experiment: experiment.to_owned(),
            metric: column.name.clone(),
            tied: tied.into_iter().map(|set| set.into_iter().map(|member| models[member].clone()).collect()).collect(),
            models,
            detectable: Reach::of(&tests, confidence),
            tests,
        }
    }
}

impl PairTest {
    fn of(first: &Entrant, second: &Entrant, confidence: f64) -> Self {
        let (a, b) = (&first.outcomes, &second.outcomes);
        let count = |bits: &BooleanBuffer| bits.count_set_bits() as u64;
        let [either, paired, defined] = [&a.present | &b.present, &a.single & &b.single, &a.defined & &b.defined];
        let (both, n) = (count(&(&a.one & &b.one)), count(&defined));
        let (first_only, second_only) = (count(&(&a.one & &defined)) - both, count(&(&b.one & &defined)) - both);
        let pairs = Pairs { both, first_only, second_only, neither: n - both - first_only - second_only };
        let (missing, undefined) = (count(&either) - count(&paired), count(&paired) - n);
        Self {
            first: first.model.to_owned(),
            second: second.model.to_owned(),
            pairs,
            n: pairs.n(),
            missing,
            undefined,
            difference: pairs.difference(),
            interval: pairs.interval(confidence),
            p: pairs.mcnemar(),
            p_adjusted: None,
            separated: false,
        }
    }
}

impl Outcomes {
    fn of(rows: &[Range<usize>], column: &MetricColumn) -> Self {
        let only = |at: usize| (rows[at].len() == 1).then_some(rows[at].start);
        let value = |at: usize| only(at).and_then(|row| column.get(row));
        let bits = |of: &dyn Fn(usize) -> bool| BooleanBuffer::collect_bool(rows.len(), of);
        Self {
            present: bits(&|at| !rows[at].is_empty()),
            single: bits(&|at| only(at).is_some()),
            defined: bits(&|at| value(at).is_some()),
            one: bits(&|at| value(at) == Some(1)),
        }
    }
}

impl Reach {
    #[expect(clippy::cast_precision_loss, reason = "a family has few tests")]
    fn of(tests: &[PairTest], confidence: f64) -> Self {
        let n = tests.iter().map(|test| test.n).max().unwrap_or(0);
        let count = tests.iter().filter(|test| test.p.is_some()).count();
        let at = |tests: usize| level(confidence).and_then(|level| detectable(n, level / tests as f64));
        Self { n, tests: count, single: at(1), family: at(count.max(1)) }
    }
}

impl Gap {
    /// Everything that keeps episodes from being paired, by experiment, model, seed and run.
    pub(super) fn all(study: &Study) -> Vec<Self> {
        let mut gaps = Vec::new();
        for experiment in &study.experiments {
            let places = Places::of(&experiment.blocks, study.table);
            for (block, rows) in experiment.blocks.iter().zip(&places.rows) {
                for (&(seed, run), rows) in places.all.iter().zip(rows).filter(|(_, rows)| rows.len() != 1) {
                    let (experiment, model) = (block.experiment.to_owned(), block.model.to_owned());
                    gaps.push(Self { experiment, model, seed, run, episodes: rows.len() });
                }
            }
        }
        gaps
    }
}

/// The models, best mean first.
fn entrants<'a>(study: &Study, blocks: &[Block<'a>], places: &Places, column: &MetricColumn) -> Vec<Entrant<'a>> {
    let entrant = |(block, rows): (&Block<'a>, &Vec<Range<usize>>)| Entrant {
        model: block.model,
        mean: block.moments(column).mean(),
        outcomes: Outcomes::of(rows, column),
    };
    let mut entrants: Vec<_> = blocks.iter().zip(&places.rows).map(entrant).collect();
    let better = study.better(&column.name);
    entrants.sort_by(|a, b| by_mean(a.mean, b.mean, better).then_with(|| a.model.cmp(b.model)));
    entrants
}

/// The better mean first, undefined ones last.
fn by_mean(a: Option<f64>, b: Option<f64>, better: Better) -> Ordering {
    match (a, b) {
        (Some(a), Some(b)) if better == Better::Lower => a.total_cmp(&b),
        (Some(a), Some(b)) => b.total_cmp(&a),
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}

/// Fills in the adjusted values and what follows from them; a pair without a test is not in the family.
fn adjust(tests: &mut [PairTest], confidence: f64) {
    let p_values: Vec<f64> = tests.iter().filter_map(|test| test.p).collect();
    for (test, adjusted) in tests.iter_mut().filter(|test| test.p.is_some()).zip(holm(&p_values)) {
        test.p_adjusted = Some(adjusted);
        test.separated = level(confidence).is_some_and(|level| adjusted <= level);
    }
}
