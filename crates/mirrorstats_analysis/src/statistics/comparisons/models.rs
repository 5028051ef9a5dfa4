//! Compares models in one experiment: paired or not, with tied sets instead of ranks.

use std::cmp::Ordering;
use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::compare::{Compared, Comparison, Method};
use crate::statistics::comparisons::family::adjust;
use crate::statistics::comparisons::matching::{Matched, Matching, Scenes};
use crate::statistics::rates::durations::{self, is_duration};
use crate::study::{Block, Experiment, RowKey, Study, couples};
use mirrorstats_metric::catalogs::catalog::Better;
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::comparisons::holm::level;
use mirrorstats_statistics::comparisons::letter_display::tied_sets;
use mirrorstats_statistics::power::{Detectable, detectable, detectable_unpaired};

/// All comparisons of models under one rate or duration in one experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Family {
    /// The experiment.
    pub experiment: String,
    /// The metric, a rate or a duration.
    pub metric: String,
    /// The models, best mean first (of durations the restricted mean), each unit counted once; by name where means are
    /// equal. A model with
    /// conditions is there once per condition, as `model [condition]`.
    pub models: Vec<String>,
    /// Sets of models that no adjusted test tells apart, each as large as can be; they may overlap.
    pub tied: Vec<Vec<String>>,
    /// Every pair of models, in the order of `models`.
    pub tests: Vec<PairTest>,
    /// The least difference of a rate that this many episodes could have shown; `None` for a duration.
    pub detectable: Option<Reach>,
}

/// The smallest differences that could have been shown; none if no outcome would have been enough.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reach {
    /// The test that this is said of.
    pub method: Method,
    /// The most pairs that any two models share, or the most episodes that both of two models have.
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
    /// The model that the estimate of this comparison favours.
    pub first: String,
    /// The other one.
    pub second: String,
    /// The matching of their episodes.
    pub matching: Matching,
    /// The first minus the second, adjusted over all pairs of models in the experiment.
    #[serde(flatten)]
    pub comparison: Comparison,
}

/// A scene that models have with which this one is compared by pairs, and that this one has not, or more than once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Gap {
    #[serde(flatten)]
    pub key: RowKey,
    /// The scene, as the traces name it.
    pub scene: String,
    /// The number of episodes instead of one.
    pub episodes: usize,
}

/// A metric, and the horizon of a duration.
#[derive(Clone, Copy)]
struct Asked<'c> {
    column: &'c MetricColumn,
    horizon: Option<i64>,
}

/// All blocks of an experiment, each matched with each once for all metrics.
struct MatchedBlocks<'s, 'a> {
    study: &'s Study<'a>,
    blocks: &'s [Block<'a>],
    scenes: Vec<Scenes>,
    matched: Vec<Vec<Matched>>,
}

impl<'s, 'a> MatchedBlocks<'s, 'a> {
    fn of(study: &'s Study<'a>, experiment: &'s Experiment<'a>) -> Self {
        let scenes: Vec<Scenes> = experiment.blocks.iter().map(|block| Scenes::of(study, block)).collect();
        let of_first = |first| scenes.iter().map(|second| Matched::of(first, second)).collect();
        Self { study, blocks: &experiment.blocks, matched: scenes.iter().map(of_first).collect(), scenes }
    }

    fn test(&self, asked: Asked, (first, second): (usize, usize), confidence: f64) -> PairTest {
        let Asked { column, horizon } = asked;
        let (study, matched) = (self.study, &self.matched[first][second]);
        let (first, second) = (&self.blocks[first], &self.blocks[second]);
        let compared = Compared { study, first, second, matched, horizon, confidence };
        let comparison = compared.under(column).unless(study.incomparable(first, second));
        PairTest { first: first.name(), second: second.name(), matching: matched.matching, comparison }
    }

    /// The test of a pair with the better side of its own estimate first. Pairs use the scenes of both models only, so
    /// their difference may point the other way than the models' means.
    fn better_first(&self, asked: Asked, (first, second): (usize, usize)) -> (PairTest, (usize, usize)) {
        let test = |pair| (self.test(asked, pair, self.study.confidence), pair);
        let found = test((first, second));
        let is_worse = self.study.is_worse(&asked.column.name, found.0.comparison.difference);
        if is_worse { test((second, first)) } else { found }
    }

    fn gaps(&self) -> Vec<Gap> {
        let mut gaps = Vec::new();
        for (at, block) in self.blocks.iter().enumerate() {
            let is_partner = |other: &usize| *other != at && self.matched[at][*other].matching.paired;
            let partners = (0..self.blocks.len()).filter(is_partner);
            let mut scenes: BTreeSet<usize> =
                partners.flat_map(|other| self.scenes[other].rows.keys().copied()).collect();
            if scenes.is_empty() {
                continue;
            }
            scenes.extend(self.scenes[at].rows.keys());
            gaps.extend(scenes.into_iter().filter_map(|scene| self.gap(block, at, scene)));
        }
        gaps
    }

    fn gap(&self, block: &Block, at: usize, scene: usize) -> Option<Gap> {
        let episodes = self.scenes[at].rows.get(&scene).map_or(0, Vec::len);
        let row = self.scenes.iter().find_map(|scenes| scenes.rows.get(&scene)?.first().copied())?;
        (episodes != 1).then(|| Gap {
            key: block.key(),
            scene: self.study.scenes().and_then(|scenes| scenes.get(row)).unwrap_or_default().to_owned(),
            episodes,
        })
    }
}

/// The index of a pair among the pairs of `count` members, listed row by row of the upper triangle.
fn triangle(count: usize, a: usize, b: usize) -> usize {
    a * (2 * count - a - 1) / 2 + (b - a - 1)
}

pub(crate) fn compared(study: &Study) -> (Vec<Family>, Vec<Gap>) {
    let (mut families, mut gaps) = (Vec::new(), Vec::new());
    for experiment in study.experiments.iter().filter(|experiment| experiment.blocks.len() > 1) {
        let field = MatchedBlocks::of(study, experiment);
        for column in &study.table.metrics {
            let is_duration = is_duration(study, &column.name);
            // Models are ordered and compared up to one horizon, the one in the table of durations.
            let horizon = is_duration.then(|| durations::horizon_of(study, experiment, column)).flatten();
            if is_duration || study.is_rate(&column.name) {
                families.push(Family::of(experiment.name, &field, Asked { column, horizon }));
            }
        }
        gaps.extend(field.gaps());
    }
    (families, gaps)
}

impl Family {
    pub(crate) fn comparisons(&self) -> impl Iterator<Item = &Comparison> {
        self.tests.iter().map(|test| &test.comparison)
    }

    fn of(experiment: &str, field: &MatchedBlocks, asked: Asked) -> Self {
        let (study, column) = (field.study, asked.column);
        let order = best_first(field, asked);
        let mut tests: Vec<_> = couples(&order).map(|(a, b)| field.better_first(asked, (*a, *b))).collect();
        let family = tests.iter_mut().map(|(test, pair)| {
            let again = |confidence| field.test(asked, *pair, confidence).comparison;
            (&mut test.comparison, again)
        });
        adjust(family, study.margin_of(column), study.confidence);
        let tests: Vec<PairTest> = tests.into_iter().map(|(test, _)| test).collect();
        let models: Vec<String> = order.iter().map(|&at| field.blocks[at].name()).collect();
        let tied = tied_sets(models.len(), |a, b| tests[triangle(models.len(), a, b)].comparison.separated);
        Self {
            experiment: experiment.to_owned(),
            metric: column.name.clone(),
            tied: tied.into_iter().map(|set| set.into_iter().map(|member| models[member].clone()).collect()).collect(),
            models,
            detectable: Reach::of(&tests, study.confidence),
            tests,
        }
    }
}

impl Reach {
    fn of(tests: &[PairTest], confidence: f64) -> Option<Self> {
        let of_method = |method| {
            let tested =
                tests.iter().map(|test| &test.comparison).filter(move |it| it.method == method && it.p.is_some());
            tested.map(|it| it.n[0].min(it.n[1])).max().map(|n| (method, n))
        };
        let (method, n) = of_method(Method::Mcnemar).or_else(|| of_method(Method::Fisher))?;
        let count = tests.iter().filter(|test| test.comparison.p.is_some()).count();
        let least = if method == Method::Mcnemar { detectable } else { detectable_unpaired };
        let at = |tests: usize| level(confidence).and_then(|level| least(n, level / tests as f64));
        Some(Self { method, n, tests: count, single: at(1), family: at(count.max(1)) })
    }
}

fn best_first(field: &MatchedBlocks, Asked { column, horizon }: Asked) -> Vec<usize> {
    let mean = |block: &Block| match horizon {
        Some(horizon) => durations::restricted(field.study, block, column, horizon),
        None => field.study.mean(block, column),
    };
    let means: Vec<Option<f64>> = field.blocks.iter().map(mean).collect();
    let better = field.study.metric(&column.name).better;
    let mut order: Vec<usize> = (0..field.blocks.len()).collect();
    // Blocks are ordered by name, and the sort is stable.
    order.sort_by(|&a, &b| by_mean(means[a], means[b], better));
    order
}

pub(crate) fn by_mean(a: Option<f64>, b: Option<f64>, better: Better) -> Ordering {
    match (a, b) {
        (Some(a), Some(b)) if better == Better::Lower => a.total_cmp(&b),
        (Some(a), Some(b)) => b.total_cmp(&a),
        (a, b) => b.is_some().cmp(&a.is_some()),
    }
}
