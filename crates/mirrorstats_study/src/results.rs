//! The requested and the actual results of a scan, and the best models in them.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use mirrorstats_figures::e5_outcomes::Outcomes;
use mirrorstats_figures::{FigureName, gaze};
use mirrorstats_metric::catalogs::catalog::Better;
use mirrorstats_report::bundle;
use mirrorstats_score::quality::QualityByCell;
use mirrorstats_score::tables::table::CONDITION;
use mirrorstats_score::tables::table::{EpisodeKey, EpisodeTable, MetricColumn};
use mirrorstats_score::timeline::Timeline;

/// The requested results besides the episode table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "each output is asked for by itself")]
pub struct Outputs {
    /// Times of looks, claims and decisions, for the figure `gaze`, and the endings of open questions, for `e5-outcomes`.
    pub timelines: bool,
    pub quality: bool,
    /// The hashes of the inputs.
    pub hashes: bool,
    /// The episodes that may be copies of others.
    pub copy_candidates: bool,
    /// The labels that the design audit reads.
    pub design: bool,
}

impl Outputs {
    /// The inputs of these figures.
    pub fn of_figures(names: &[FigureName]) -> Self {
        let timelines = names.contains(&FigureName::Gaze) || names.contains(&FigureName::E5Outcomes);
        Self { timelines, design: names.contains(&FigureName::Forest), ..Self::default() }
    }
}

/// The results of a scan.
#[derive(Clone, Debug)]
pub struct Results {
    /// One row per episode.
    pub episodes: EpisodeTable,
    /// One timeline per episode, in table order. `None` if not requested, for scores, for definitions that do not name
    /// the moments, and for more episodes than `gaze` draws.
    pub timelines: Option<Vec<Timeline>>,
    /// The endings of open questions. `None` without timelines, and if there is no such question.
    pub outcomes: Option<Outcomes>,
    /// The ids of the episodes without `done` whose last reply was lost to the infrastructure. `None` if the inputs do
    /// not record it.
    pub lost: Option<BTreeSet<String>>,
    /// The reply quality by cell, lost episodes included. `None` if not requested, and for scores.
    pub quality: Option<QualityByCell>,
    /// The inputs with their hashes; empty if not requested.
    pub inputs: Vec<bundle::InputFile>,
    /// The episodes that equal another one in all columns read, except for the id; empty if not requested.
    pub copy_candidates: BTreeSet<String>,
}

impl Results {
    pub(crate) fn of(episodes: EpisodeTable) -> Self {
        let (timelines, outcomes, lost, quality) = (None, None, None, None);
        Self { episodes, timelines, outcomes, lost, quality, inputs: Vec::new(), copy_candidates: BTreeSet::new() }
    }

    /// The same results, with a non-default condition in the model's name: `model [condition]`.
    pub(crate) fn with_conditions_as_models(&self) -> Cow<'_, Self> {
        if !self.episodes.has_conditions() {
            return Cow::Borrowed(self);
        }
        let (episodes, order) = self.episodes.with_labelled_models(CONDITION);
        let timelines = self.timelines.as_ref();
        let timelines = timelines.map(|timelines| {
            let of = |(row, was): (usize, &usize)| {
                let model = episodes.keys.get(row).model.to_owned();
                let line = timelines[*was].clone();
                Timeline { key: EpisodeKey { model, ..line.key.clone() }, ..line }
            };
            order.iter().enumerate().map(|(row, was)| of((row, was))).collect()
        });
        Cow::Owned(Self { episodes, timelines, ..self.clone() })
    }

    /// Finds the endings of open questions; drops timelines that are too many to draw.
    pub(crate) fn find_outcomes(&mut self) {
        if self.timelines.is_some() && Outcomes::are_there(&self.episodes) {
            let shown = self.with_conditions_as_models();
            let answered: Vec<bool> = shown.timelines.iter().flatten().map(|line| line.answered).collect();
            self.outcomes = Outcomes::from_table(&shown.episodes, &answered);
        }
        if self.episodes.len() > gaze::MOST_EPISODES {
            self.timelines = None;
        }
    }

    pub(crate) fn top_models(self, most: usize, metric: &str) -> Self {
        let episodes = &self.episodes;
        let Some(column) = episodes.metric(metric) else { return self };
        let mut means = model_means(episodes, column);
        if episodes.catalog.metric.get(metric).is_some_and(|metric| metric.better == Better::Lower) {
            means.sort_by(|a, b| b.experiments.len().cmp(&a.experiments.len()).then(a.mean.total_cmp(&b.mean)));
        }
        let kept: BTreeSet<&str> = means.iter().take(most).map(|mean| mean.model).collect();
        let is_kept = |row: &usize| kept.contains(episodes.keys.get(*row).model);
        let rows: Vec<usize> = (0..episodes.len()).filter(is_kept).collect();
        let mut outcomes = self.outcomes.clone();
        if let Some(found) = &mut outcomes {
            found.rows.retain(|model, _| kept.contains(model.as_str()));
        }
        Self { outcomes, ..self.taken(&rows) }
    }

    /// The results of these rows; everything that is not by episode stays.
    fn taken(self, rows: &[usize]) -> Self {
        let timelines = self.timelines.map(|lines| rows.iter().map(|row| lines[*row].clone()).collect());
        Self { episodes: self.episodes.taken(rows), timelines, ..self }
    }
}

/// The mean of a model over experiments, each with equal weight.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelMean<'t> {
    pub model: &'t str,
    pub mean: f64,
    pub experiments: BTreeMap<&'t str, f64>,
}

/// The models by their means, the largest first. Models that lack experiments come last, since their means are not
/// comparable. This is an initial order, not a test.
pub fn model_means<'t>(episodes: &'t EpisodeTable, metric: &MetricColumn) -> Vec<ModelMean<'t>> {
    let mut sums: BTreeMap<&'t str, BTreeMap<&'t str, (i128, u32)>> = BTreeMap::new();
    for (key, value) in episodes.keys.iter().zip(metric.iter()) {
        let Some(value) = value else { continue };
        let (sum, count) = sums.entry(key.model).or_default().entry(key.experiment).or_default();
        (*sum, *count) = (*sum + i128::from(value), *count + 1);
    }
    #[expect(clippy::cast_precision_loss, reason = "a mean that puts models in an order")]
    let mean = |(experiment, (sum, count)): (&'t str, (i128, u32))| (experiment, sum as f64 / f64::from(count));
    let mut models: Vec<_> = sums
        .into_iter()
        .map(|(model, of)| {
            let experiments: BTreeMap<&str, f64> = of.into_iter().map(mean).collect();
            let count = u32::try_from(experiments.len()).unwrap_or(u32::MAX);
            ModelMean { model, mean: experiments.values().sum::<f64>() / f64::from(count), experiments }
        })
        .collect();
    models.sort_by(|a, b| {
        let by_mean = || b.mean.total_cmp(&a.mean).then(a.model.cmp(b.model));
        b.experiments.len().cmp(&a.experiments.len()).then_with(by_mean)
    });
    models
}
