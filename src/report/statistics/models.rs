//! Models against each other in one experiment: paired by seed and run, and sets of ties instead of ranks.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::study::{Block, Place, Study};
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

/// A model's rows by seed and run.
struct Entrant<'a> {
    model: &'a str,
    mean: Option<f64>,
    places: BTreeMap<Place, Vec<usize>>,
}

impl Family {
    /// Every rate in every experiment with at least two models.
    pub(super) fn all(study: &Study, confidence: f64) -> Vec<Self> {
        let mut families = Vec::new();
        for experiment in study.experiments.iter().filter(|experiment| experiment.blocks.len() > 1) {
            for column in study.rates() {
                let entrants = entrants(study, &experiment.blocks, column);
                families.push(Self::of(experiment.name, column, &entrants, confidence));
            }
        }
        families
    }

    fn of(experiment: &str, column: &MetricColumn, entrants: &[Entrant], confidence: f64) -> Self {
        let mut tests = Vec::new();
        for (at, first) in entrants.iter().enumerate() {
            tests.extend(entrants[at + 1..].iter().map(|second| PairTest::of(first, second, column, confidence)));
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
    fn of(first: &Entrant, second: &Entrant, column: &MetricColumn, confidence: f64) -> Self {
        let (mut pairs, mut missing, mut undefined) = (Pairs::default(), 0, 0);
        let places: BTreeSet<Place> = first.places.keys().chain(second.places.keys()).copied().collect();
        for place in places {
            match (first.only(place), second.only(place)) {
                (Some(a), Some(b)) => match (column.get(a), column.get(b)) {
                    (Some(a), Some(b)) => pairs = pairs.with(a == 1, b == 1),
                    _ => undefined += 1,
                },
                _ => missing += 1,
            }
        }
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

impl Entrant<'_> {
    /// The row at this place, if there is exactly one.
    fn only(&self, place: Place) -> Option<usize> {
        self.places.get(&place).and_then(|rows| <[usize; 1]>::try_from(rows.as_slice()).ok()).map(|[row]| row)
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
            let places: Vec<_> = experiment.blocks.iter().map(|block| block.places(study.table)).collect();
            let union: BTreeSet<&Place> = places.iter().flat_map(BTreeMap::keys).collect();
            for (block, places) in experiment.blocks.iter().zip(&places) {
                for &place in &union {
                    let episodes = places.get(place).map_or(0, Vec::len);
                    if episodes != 1 {
                        let (seed, run) = *place;
                        let (experiment, model) = (block.experiment.to_owned(), block.model.to_owned());
                        gaps.push(Self { experiment, model, seed, run, episodes });
                    }
                }
            }
        }
        gaps
    }
}

/// The models, best mean first.
fn entrants<'a>(study: &Study, blocks: &[Block<'a>], column: &MetricColumn) -> Vec<Entrant<'a>> {
    let entrant = |block: &Block<'a>| Entrant {
        model: block.model,
        mean: block.moments(column).mean(),
        places: block.places(study.table),
    };
    let mut entrants: Vec<_> = blocks.iter().map(entrant).collect();
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
