//! The models by their means over all experiments, and the best of them.

use std::collections::{BTreeMap, BTreeSet};

use super::results::Results;
use metric::catalog::Better;
use report::figures::e5_outcomes::Outcomes;
use score::table::{EpisodeTable, MetricColumn};

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

impl Results {
    /// The results of the `most` best models by a metric.
    pub(super) fn of_the_best(self, most: usize, metric: &str) -> Self {
        let episodes = &self.episodes;
        let Some(column) = episodes.metric(metric) else { return self };
        let mut means = model_means(episodes, column);
        if episodes.catalog.metric.get(metric).is_some_and(|metric| metric.better == Better::Lower) {
            means.sort_by(|a, b| b.experiments.len().cmp(&a.experiments.len()).then(a.mean.total_cmp(&b.mean)));
        }
        let kept: BTreeSet<&str> = means.iter().take(most).map(|mean| mean.model).collect();
        let is_kept = |row: &usize| kept.contains(episodes.keys.get(*row).model);
        let rows: Vec<usize> = (0..episodes.len()).filter(is_kept).collect();
        let timelines = self.timelines.as_ref().map(|lines| rows.iter().map(|row| lines[*row].clone()).collect());
        let outcomes = self.outcomes.clone().map(|Outcomes { experiment, mut rows }| {
            rows.retain(|row| kept.contains(row.model.as_str()));
            Outcomes { experiment, rows }
        });
        Self { episodes: episodes.taken(&rows), timelines, outcomes, ..self }
    }
}
