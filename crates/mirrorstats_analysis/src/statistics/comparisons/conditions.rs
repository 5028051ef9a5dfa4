//! Contrasts of experiments for each model: those that the definitions declare by `control`, else the first experiment
//! minus each other one.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::comparable::tasks_differ;
use crate::statistics::comparisons::compare::{Compared, Comparison};
use crate::statistics::comparisons::family::adjust;
use crate::statistics::comparisons::matching::{Matched, Matching, Scenes};
use crate::study::{Block, Experiment, Study, named};
use mirrorstats_score::tables::table::MetricColumn;

/// The difference of a model's mean between two experiments, by pairs if their scenes agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Contrast {
    /// The model.
    pub model: String,
    /// The condition, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// The metric.
    pub metric: String,
    /// The experiment that comes first in the definitions.
    pub baseline: String,
    /// The experiment subtracted from it.
    pub against: String,
    /// The matching of the episodes of the two experiments.
    pub matching: Matching,
    /// The baseline minus the other, adjusted over all models under the same metric and experiments.
    #[serde(flatten)]
    pub comparison: Comparison,
}

pub(crate) struct ConditionPair<'s, 'a> {
    baseline: &'s Experiment<'a>,
    against: &'s Experiment<'a>,
    /// The declared metrics; all if empty.
    on: &'a [String],
}

impl<'s, 'a> ConditionPair<'s, 'a> {
    fn all(study: &'s Study<'a>) -> Vec<Self> {
        let known = &study.table.catalog.experiment;
        if known.values().any(|experiment| experiment.control.is_some()) {
            let declared = |against: &'s Experiment<'a>| {
                let control = known.get(against.name)?.control.as_ref()?;
                let baseline = study.experiments.iter().find(|experiment| experiment.name == control.of)?;
                Some(Self { baseline, against, on: &control.on })
            };
            return study.experiments.iter().filter_map(declared).collect();
        }
        let Some((baseline, others)) = study.experiments.split_first() else { return Vec::new() };
        others.iter().map(|against| Self { baseline, against, on: &[] }).collect()
    }

    fn columns(&self, study: &Study<'a>) -> Vec<&'a MetricColumn> {
        study.table.metrics.iter().filter(|column| self.on.is_empty() || self.on.contains(&column.name)).collect()
    }

    /// The blocks of one model and condition in both experiments.
    pub(crate) fn couples(&self) -> impl Iterator<Item = (&'s Block<'a>, &'s Block<'a>)> {
        let firsts = &self.baseline.blocks;
        let same = move |second: &'s Block<'a>| {
            firsts.iter().filter(|first| second.is_same_subject(first)).map(move |first| (first, second))
        };
        self.against.blocks.iter().flat_map(same)
    }
}

impl Contrast {
    pub fn name(&self) -> String {
        named(&self.model, self.condition.as_deref())
    }

    pub(crate) fn all(study: &Study) -> Vec<Self> {
        let mut contrasts = Vec::new();
        for pair in Self::pairs(study) {
            let (mut family, columns) = (Vec::new(), pair.columns(study));
            let matched = |(first, second)| Matched::of(&Scenes::of(study, first), &Scenes::of(study, second));
            let couples: Vec<_> = pair.couples().map(|couple| (couple, matched(couple))).collect();
            let compared = |at: usize, column: &MetricColumn, confidence| {
                let ((first, second), matched) = &couples[at];
                let compared = Compared { study, first, second, matched, horizon: None, confidence };
                compared.under(column).unless(study.incomparable(first, second))
            };
            for (at, ((first, second), matched)) in couples.iter().enumerate() {
                let under = |column: &MetricColumn| Self {
                    model: first.model.to_owned(),
                    condition: first.condition(),
                    metric: column.name.clone(),
                    baseline: first.experiment.to_owned(),
                    against: second.experiment.to_owned(),
                    matching: matched.matching,
                    comparison: compared(at, column, study.confidence),
                };
                family.extend(columns.iter().map(|column| (at, under(column))));
            }
            for column in columns {
                let of_metric = family.iter_mut().filter(|(_, it): &&mut (usize, Self)| it.metric == column.name);
                let again = |at: usize| move |confidence| compared(at, column, confidence);
                let of_metric = of_metric.map(|(at, it)| (&mut it.comparison, again(*at)));
                adjust(of_metric, study.margin_of(column), study.confidence);
            }
            contrasts.extend(family.into_iter().map(|(_, contrast)| contrast));
        }
        contrasts
    }

    /// The pairs of experiments with similar tasks.
    pub(crate) fn pairs<'s, 'a>(study: &'s Study<'a>) -> Vec<ConditionPair<'s, 'a>> {
        let catalog = &study.table.catalog;
        let is_like = |pair: &ConditionPair| tasks_differ(catalog, pair.baseline.name, pair.against.name).is_none();
        ConditionPair::all(study).into_iter().filter(is_like).collect()
    }

    pub(crate) fn left_out(study: &Study) -> Vec<String> {
        let sentence = |pair: ConditionPair| {
            let (baseline, against) = (pair.baseline.name, pair.against.name);
            let why = tasks_differ(&study.table.catalog, baseline, against)?;
            Some(format!("{against} is not contrasted with {baseline}: {why}."))
        };
        ConditionPair::all(study).into_iter().filter_map(sentence).collect()
    }
}
