//! The definitions in the words of their file, for readers.

use serde::Serialize;

use crate::base::visible::visible;
use crate::metric::catalog::{Better, Catalog, Kind, Metric, StandardError};

/// One metric: its sentence, and the expressions behind it.
#[derive(Debug, Serialize)]
pub(super) struct MetricView {
    name: String,
    title: String,
    help: String,
    value: String,
    when: Option<String>,
    is_rate: bool,
    /// Unit, direction and source in a few words.
    remarks: String,
}

/// A named expression.
#[derive(Debug, Serialize)]
pub(super) struct LetView {
    name: String,
    value: String,
}

/// An experiment and its levels.
#[derive(Debug, Serialize)]
pub(super) struct ExperimentView {
    name: String,
    title: String,
    /// `TSA 1/3`, ...
    chance: String,
    /// `TSA 1/10, 1/11`, ...
    reference: String,
}

impl MetricView {
    /// Every metric of a catalog, in its order.
    pub(super) fn all(catalog: &Catalog) -> Vec<Self> {
        catalog.metric.iter().map(|(name, metric)| Self::new(name, metric)).collect()
    }

    /// The metric's name as a key of JSON.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    fn new(name: &str, metric: &Metric) -> Self {
        Self {
            name: visible(name),
            title: visible(&metric.title),
            help: visible(&metric.help),
            value: multiline(&metric.value),
            when: metric.when.as_deref().map(multiline),
            is_rate: metric.kind == Kind::Rate,
            remarks: remarks(metric),
        }
    }
}

impl LetView {
    /// Every named expression of a catalog, in its order.
    pub(super) fn all(catalog: &Catalog) -> Vec<Self> {
        catalog.lets.iter().map(|(name, value)| Self { name: visible(name), value: multiline(value) }).collect()
    }
}

impl ExperimentView {
    /// Every experiment of a catalog, in its order.
    pub(super) fn all(catalog: &Catalog) -> Vec<Self> {
        let view = |(name, experiment): (&String, &crate::metric::catalog::Experiment)| {
            let chance = experiment.chance.iter().map(|(metric, level)| match level {
                Some(level) => format!("{} {level}", visible(metric)),
                None => format!("{} none", visible(metric)),
            });
            let reference = experiment.reference.iter().map(|(metric, levels)| {
                let levels: Vec<String> = levels.iter().map(ToString::to_string).collect();
                format!("{} {}", visible(metric), levels.join(", "))
            });
            Self {
                name: visible(name),
                title: visible(&experiment.title),
                chance: chance.collect::<Vec<_>>().join("; "),
                reference: reference.collect::<Vec<_>>().join("; "),
            }
        };
        catalog.experiment.iter().map(view).collect()
    }
}

fn remarks(metric: &Metric) -> String {
    let mut remarks = vec![match metric.kind {
        Kind::Rate => "rate, 0 or 1 an episode".to_owned(),
        Kind::Quantity => visible(&metric.unit),
    }];
    remarks.extend(match metric.better {
        Better::Higher => Some("higher is better".to_owned()),
        Better::Lower => Some("lower is better".to_owned()),
        Better::Neither => None,
    });
    if metric.se == StandardError::Population {
        remarks.push("standard error of the population form".to_owned());
    }
    remarks.extend(metric.chance.map(|chance| format!("chance {chance}")));
    if !metric.section.is_empty() {
        remarks.push(format!("paper {}", visible(&metric.section)));
    }
    remarks.retain(|remark| !remark.is_empty());
    remarks.join(" · ")
}

/// An expression as written, its line breaks kept.
fn multiline(text: &str) -> String {
    text.trim().lines().map(visible).collect::<Vec<_>>().join("\n")
}
