//! The cells as input of figures: experiments by models, with one reading per metric.

use std::collections::{BTreeMap, BTreeSet};

use crate::kit::Mark;
use crate::{FigureError, FigureName};
use mirrorstats_exact::format::counted;
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Better, Catalog, Kind, Metric};
use mirrorstats_score::cells::{Cells, Group, KeyValue};
use mirrorstats_statistics::intervals::interval::{self, Interval};

pub(crate) const CONFIDENCE: f64 = 0.95;

/// One metric of a model in an experiment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading<'a> {
    experiment: &'a str,
    model: &'a str,
    metric: MetricId<'a>,
    pub value: Value,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    /// There are no episodes of this model in this experiment.
    Empty,
    /// The number of episodes; the metric is undefined in all of them.
    Undefined(u64),
    Known {
        moments: Moments,
        /// True if a scene, cluster or participant has several of the episodes.
        repeats: bool,
    },
}

impl Reading<'_> {
    pub(crate) fn moments(self) -> Option<Moments> {
        if let Value::Known { moments, .. } = self.value { Some(moments) } else { None }
    }

    pub(crate) fn mean(self) -> Option<f64> {
        self.metric.metric.mean(&self.moments()?)
    }

    pub(crate) fn n(self) -> u64 {
        self.moments().map_or(0, |moments| moments.n)
    }

    /// Returns true if episodes share a scene, cluster or participant, and so are not independent.
    pub(crate) fn repeats(self) -> bool {
        matches!(self.value, Value::Known { repeats: true, .. })
    }

    /// The 95 % interval of a rate; `None` for repeats.
    pub(crate) fn wilson(self) -> Option<Interval> {
        let Value::Known { moments, repeats: false } = self.value else { return None };
        interval::wilson(u64::try_from(moments.sum).ok()?, moments.n, CONFIDENCE)
    }

    /// The mean with `places` decimal places, correctly rounded from the exact fraction.
    pub(crate) fn decimal(self, places: u32) -> Option<Decimal> {
        let moments = self.moments()?;
        let below = i128::from(moments.n) * i128::from(self.metric.metric.scale());
        Decimal::of_ratio(moments.sum, below, places)
    }

    /// The value as shown on hover: the full mean and its components.
    pub(crate) fn words(self) -> String {
        match self.value {
            Value::Empty => "no episodes".to_owned(),
            Value::Undefined(episodes) => format!("undefined (0 of {})", counted(episodes, "episode")),
            Value::Known { moments, .. } => {
                let mean = self.decimal(4).map(|mean| mean.to_string()).unwrap_or_default();
                let [sum, _] = self.metric.metric.sums(&moments);
                format!("{mean} ({sum}/{n}, n = {n})", n = moments.n)
            }
        }
    }

    pub(crate) fn mark(self) -> Mark {
        let Self { experiment, model, metric: MetricId { name: metric, .. }, .. } = self;
        let title = format!("{experiment} · {model} · {metric}: {}", self.words());
        Mark::of_cell(title, experiment, model, metric).value(self.mean()).with("n", self.n())
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Matrix<'a> {
    cells: &'a Cells,
    groups: BTreeMap<(&'a str, &'a str), &'a Group>,
    /// The experiments that have episodes, in the order of the definitions, unknown ones last by name.
    pub experiments: Vec<&'a str>,
    pub models: Vec<&'a str>,
}

impl<'a> Matrix<'a> {
    pub(crate) fn new(cells: &'a Cells) -> Result<Self, FigureError> {
        let fault = || FigureError::Grouping { found: cells.by.join(",") };
        let place = |name: &str| cells.by.iter().position(|key| key == name).ok_or_else(fault);
        let (experiment, model) = (place("experiment")?, place("model")?);
        if cells.by.len() != 2 {
            return Err(fault());
        }
        let mut groups = BTreeMap::new();
        for group in &cells.groups {
            let (KeyValue::Text(experiment), KeyValue::Text(model)) = (&group.key[experiment], &group.key[model])
            else {
                return Err(fault());
            };
            groups.insert((experiment.as_str(), model.as_str()), group);
        }
        if groups.is_empty() {
            return Err(FigureError::NoEpisodes);
        }
        let mut experiments: Vec<_> = groups.keys().map(|&(e, _)| e).collect::<BTreeSet<_>>().into_iter().collect();
        experiments.sort_by_key(|e| cells.catalog.experiment_rank(e));
        let models = groups.keys().map(|&(_, m)| m).collect::<BTreeSet<_>>().into_iter().collect();
        Ok(Self { cells, groups, experiments, models })
    }

    pub(crate) fn pairs(&self) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.experiments.iter().flat_map(|&experiment| self.models.iter().map(move |&model| (experiment, model)))
    }

    pub(crate) fn metric(&self, figure: FigureName, name: &str) -> Result<MetricId<'a>, FigureError> {
        self.metrics().into_iter().find(|id| id.name == name).ok_or_else(|| FigureError::UnknownMetric {
            figure,
            metric: name.to_owned(),
            known: self.cells.metrics.join(", "),
        })
    }

    pub(crate) fn catalog(&self) -> &'a Catalog {
        &self.cells.catalog
    }

    pub(crate) fn metrics(&self) -> Vec<MetricId<'a>> {
        let names = self.cells.metrics.iter().enumerate();
        names
            .filter_map(|(at, name)| Some(MetricId { name, at, metric: self.cells.catalog.metric.get(name)? }))
            .collect()
    }

    pub(crate) fn reading<'r>(&self, experiment: &'r str, model: &'r str, metric: MetricId<'r>) -> Reading<'r> {
        let value = match self.groups.get(&(experiment, model)) {
            None => Value::Empty,
            Some(group) => match group.moments.get(metric.at) {
                Some(&moments) if moments.n > 0 => Value::Known { moments, repeats: group.repeats },
                _ => Value::Undefined(group.episodes),
            },
        };
        Reading { experiment, model, metric, value }
    }

    /// The mean on a scale from 0 (worst) to 1 (best); `None` without a mean.
    ///
    /// A rate is unchanged, or inverted if less is better. A quantity is scaled between the least and the largest mean
    /// of its experiment; if all are equal, each is 0.5.
    pub(crate) fn goodness(&self, experiment: &str, model: &str, metric: MetricId<'_>) -> Option<f64> {
        let mean = self.reading(experiment, model, metric).mean()?;
        let share = match metric.metric.kind {
            Kind::Rate => mean,
            Kind::Quantity => {
                let (low, high) = self.span(experiment, metric)?;
                if high > low { (mean - low) / (high - low) } else { 0.5 }
            }
        };
        Some(match metric.metric.better {
            Better::Lower => 1.0 - share,
            Better::Higher | Better::Neither => share,
        })
    }

    /// The least and the largest mean of an experiment; `None` without a mean.
    pub(crate) fn span(&self, experiment: &str, metric: MetricId<'_>) -> Option<(f64, f64)> {
        let means = self.models.iter().filter_map(|model| self.reading(experiment, model, metric).mean());
        means.fold(None, |span, mean| {
            let (low, high) = span.unwrap_or((mean, mean));
            Some((low.min(mean), high.max(mean)))
        })
    }

    pub(crate) fn chance(&self, experiment: &str, metric: MetricId<'_>) -> Option<f64> {
        self.cells.catalog.chance(experiment, metric.name).map(mirrorstats_exact::ratio::Ratio::value)
    }

    /// The rates of some blind strategies if there is no chance level, as text and value.
    pub(crate) fn references(&self, experiment: &str, metric: MetricId<'_>) -> Vec<(String, f64)> {
        let known = self.cells.catalog.experiment.get(experiment).and_then(|e| e.reference.get(metric.name));
        known.into_iter().flatten().map(|level| (level.to_string(), level.value())).collect()
    }

    /// The experiments' titles, empty if the definitions have none.
    pub(crate) fn titles(&self, experiments: &[&str]) -> Vec<&'a str> {
        let title = |name: &&str| self.cells.catalog.experiment.get(*name).map_or("", |e| e.title.as_str());
        experiments.iter().map(title).collect()
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct MetricId<'a> {
    pub name: &'a str,
    pub metric: &'a Metric,
    at: usize,
}

impl MetricId<'_> {
    pub(crate) fn attribute(self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c.to_ascii_lowercase() } else { '-' };
        self.name.chars().map(plain).collect()
    }
}
