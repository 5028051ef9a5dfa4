//! Ranks that the tests leave open, instead of an order of means.
//!
//! Rule: a model ranks below another only if it is shown to be worse. Models that rank below no other are tied for the
//! best. A family with incomparable models, or of a metric whose episodes the outcome selects, has no ranks.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::compare::Comparison;
use crate::statistics::comparisons::matching::singular;
use crate::statistics::comparisons::models::{Family, compared};
use crate::statistics::conclusions::headline;
use crate::statistics::episodes::first_named;
use crate::statistics::rates::overall::{self, OverallRow};
use crate::study::{Block, Study};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::{UNDEFINED, fixed};
use mirrorstats_exact::moments::MomentOverflow;
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::{EpisodeTable, MetricColumn};
use mirrorstats_statistics::design::Design;
use mirrorstats_tables::{Column, ListTable, Look, Table, text_field};

/// The most rates that a note names.
const MOST_NAMED: usize = 6;

pub(crate) const ALL: &str = "all";
const SENTENCE: &str = "The ranks that the tests leave open, adjusted by Holm within each experiment and metric. Models that may have \
                        rank 1 are tied for the best.";

/// The ranks of one model under one metric.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct RankRow {
    /// The experiment; null over all experiments.
    pub experiment: Option<String>,
    /// The metric.
    pub metric: String,
    /// The model, as `model [condition]` where there are conditions.
    pub model: String,
    /// The best rank that it may have: one more than the models shown to be better.
    pub best: usize,
    /// The worst rank that it may have: all models but those shown to be worse.
    pub worst: usize,
}

impl RankRow {
    pub(crate) fn all(families: &[Family], overall: &[OverallRow]) -> Vec<Self> {
        let of_family = |family: &Family| {
            let models: Vec<&str> = family.models.iter().map(String::as_str).collect();
            let separated = family.tests.iter().filter(|test| test.comparison.separated);
            let shown: Vec<(&str, &str)> = separated.map(|test| (&*test.first, &*test.second)).collect();
            ranks(Some(&family.experiment), &family.metric, &models, &shown)
        };
        let is_open = |it: &Comparison| it.incomparable.is_none() && it.selected.is_none();
        let families = families.iter().filter(|family| family.comparisons().all(is_open));
        let mut rows: Vec<Self> = families.flat_map(of_family).collect();
        for rows_of in overall.chunk_by(|a, b| a.metric == b.metric) {
            let models: BTreeSet<&str> = rows_of.iter().flat_map(|row| [&*row.first, &*row.second]).collect();
            let separated = rows_of.iter().filter(|row| row.separated);
            let shown: Vec<(&str, &str)> = separated.map(|row| (&*row.first, &*row.second)).collect();
            rows.extend(ranks(None, &rows_of[0].metric, &Vec::from_iter(models), &shown));
        }
        rows
    }

    /// `2`, or `1-3` if the tests leave several ranks open.
    pub(crate) fn interval(&self) -> String {
        if self.best == self.worst { self.best.to_string() } else { format!("{}-{}", self.best, self.worst) }
    }
}

fn ranks(experiment: Option<&str>, metric: &str, models: &[&str], shown: &[(&str, &str)]) -> Vec<RankRow> {
    let row = |model: &&str| RankRow {
        experiment: experiment.map(str::to_owned),
        metric: metric.to_owned(),
        model: (*model).to_owned(),
        best: 1 + shown.iter().filter(|(_, worse)| worse == model).count(),
        worst: models.len() - shown.iter().filter(|(better, _)| better == model).count(),
    };
    models.iter().map(row).collect()
}

/// The ranks of a table at the default confidence, in each experiment and over all of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ranks(Vec<RankRow>);

impl Ranks {
    pub fn of_table(
        table: &EpisodeTable,
        lost: &LostCounts,
        design: Design,
        pool: bool,
    ) -> Result<Self, MomentOverflow> {
        let mut study = Study::from_table(table, design, Some(lost), None)?;
        study.pool = pool;
        let (families, _) = compared(&study);
        let overall = overall::rates(&study, &families, &headline(&study));
        Ok(Self(RankRow::all(&families, &overall)))
    }

    /// The headline rates whose mean over scenes, seeds or participants is not that over episodes; `None` without any.
    pub fn unit_means(table: &EpisodeTable, design: Design) -> Result<Option<String>, MomentOverflow> {
        let study = Study::from_table(table, design, None, None)?;
        let columns: Vec<&MetricColumn> = headline(&study).iter().filter_map(|metric| study.column(metric)).collect();
        let rates = || columns.iter().filter(|column| study.is_rate(&column.name));
        let of_block = |block: &Block| {
            let unit = singular(study.unit_name(block));
            let name = format!("{} {}", block.experiment, block.name());
            let differing = |column: &&&MetricColumn| {
                let [by_unit, pooled] = [study.mean(block, column)?, block.moments(column).mean()?];
                let means = [by_unit, pooled].map(|mean| fixed(Some(mean), 3));
                let [mean, pooled] = (means[0] != means[1]).then_some(means)?;
                Some(format!("{name} {} {mean} by {unit}, {pooled} by episode", column.name))
            };
            rates().filter_map(|column| differing(&column)).collect::<Vec<_>>()
        };
        let repeated = study.blocks().filter(|block| block.repeats);
        let found: Vec<String> = repeated.flat_map(of_block).collect();
        let about =
            "Tests and ranks count each scene, seed or participant once; the means of this table count episodes";
        Ok((!found.is_empty()).then(|| format!("{about}: {}.", first_named(found.into_iter(), MOST_NAMED))))
    }

    /// Returns true if a model is tied for the best, and some other model is not.
    pub fn is_tied(&self, experiment: &str, model: &str, metric: &str) -> bool {
        let is_of = |row: &&RankRow| row.experiment.as_deref() == Some(experiment) && row.metric == metric;
        let mut family = self.0.iter().filter(is_of);
        family.clone().any(|row| row.model == model && row.best == 1) && family.any(|row| row.best > 1)
    }

    /// One line per experiment and model with the ranks under each metric; `None` without comparisons.
    pub fn list(&self) -> Option<ListTable> {
        let mut metrics: Vec<&str> = Vec::new();
        let mut lines: BTreeMap<(bool, &str, &str), BTreeMap<&str, String>> = BTreeMap::new();
        for row in &self.0 {
            if !metrics.contains(&&*row.metric) {
                metrics.push(&row.metric);
            }
            let experiment = row.experiment.as_deref();
            let line = lines.entry((experiment.is_none(), experiment.unwrap_or(ALL), &row.model)).or_default();
            line.insert(&row.metric, row.interval());
        }
        let texts = lines.iter().map(|((_, experiment, model), ranks)| {
            let cells = metrics.iter().map(|metric| ranks.get(metric).map_or(UNDEFINED, String::as_str));
            [*experiment, *model].into_iter().chain(cells).map(visible).collect::<Vec<_>>()
        });
        let columns = ["experiment", "model"].into_iter().chain(metrics.iter().copied());
        let printed = Table {
            title: "Ranks".to_owned(),
            sentences: vec![SENTENCE.to_owned()],
            label: Some("tab:ranks".to_owned()),
            ..Table::list(Look::Ruled, 2, columns.map(Column::left))
        };
        let records =
            Table::of_texts(["experiment", "metric", "model", "best", "worst"]).with(self.0.iter().map(|row| {
                let texts = [row.experiment.as_deref().unwrap_or_default(), &row.metric, &row.model];
                let texts = texts.map(text_field);
                texts.into_iter().chain([row.best, row.worst].map(|rank| rank.to_string()))
            }));
        (!self.0.is_empty()).then(|| ListTable { name: "ranks".to_owned(), printed: printed.with(texts), records })
    }
}

#[cfg(test)]
mod tests {
    use super::ranks;

    #[test]
    fn models_without_a_difference_have_overlapping_ranks() {
        let rows = ranks(Some("E1"), "TSA", &["a", "b", "c"], &[("a", "c")]);
        let found: Vec<(usize, usize)> = rows.iter().map(|row| (row.best, row.worst)).collect();
        assert_eq!(found, [(1, 2), (1, 3), (2, 3)]);
    }
}
