//! Ranks that the tests leave open, in place of an order of means.
//!
//! Rule: a model is below another where it is shown to be worse, and nowhere else. Those that are below none are tied for the
//! best. A family with models that are not comparable has no ranks.

use std::collections::BTreeSet;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::models::compared;
use super::study::Study;
use super::{Family, OverallRow};
use crate::cells::interval::CONFIDENCE;
use exact::moments::MomentOverflow;
use score::lost_counts::LostCounts;
use score::table::EpisodeTable;
use statistics::design::Design;

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
    pub(super) fn all(families: &[Family], overall: &[OverallRow]) -> Vec<Self> {
        let mut rows: Vec<Self> = families.iter().flat_map(Self::of_family).collect();
        for rows_of in overall.chunk_by(|a, b| a.metric == b.metric) {
            let models: BTreeSet<&str> = rows_of.iter().flat_map(|row| [&*row.first, &*row.second]).collect();
            let models: Vec<&str> = models.into_iter().collect();
            let shown: Vec<(&str, &str)> =
                rows_of.iter().filter(|row| row.separated).map(|row| (&*row.first, &*row.second)).collect();
            rows.extend(ranks(None, &rows_of[0].metric, &models, &shown));
        }
        rows
    }

    fn of_family(family: &Family) -> Vec<Self> {
        if family.tests.iter().any(|test| test.comparison.incomparable.is_some()) {
            return Vec::new();
        }
        let models: Vec<&str> = family.models.iter().map(String::as_str).collect();
        let separated = family.tests.iter().filter(|test| test.comparison.separated);
        let shown: Vec<(&str, &str)> = separated.map(|test| (&*test.first, &*test.second)).collect();
        ranks(Some(&family.experiment), &family.metric, &models, &shown)
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

/// The models that are tied for the best where not all are: experiment, model and metric of each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ties(BTreeSet<(String, String, String)>);

impl Ties {
    /// The ties of a table at the usual confidence.
    ///
    /// # Errors
    /// Sums of squares beyond 128 bits.
    pub fn of(table: &EpisodeTable, lost: &LostCounts, design: Design, pool: bool) -> Result<Self, MomentOverflow> {
        let mut study = Study::of(table, design, Some(lost))?;
        study.pool = pool;
        let families = compared(&study, None, CONFIDENCE).0;
        let mut tied = BTreeSet::new();
        for family in &families {
            let rows = RankRow::of_family(family);
            let is_told = rows.iter().any(|row| row.best > 1);
            let best = rows.into_iter().filter(|row| is_told && row.best == 1);
            tied.extend(best.map(|row| (family.experiment.clone(), row.model, row.metric)));
        }
        Ok(Self(tied))
    }

    /// Whether a model is tied for the best, and another one is not.
    pub fn has(&self, experiment: &str, model: &str, metric: &str) -> bool {
        self.0.contains(&(experiment.to_owned(), model.to_owned(), metric.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::ranks;

    #[test]
    fn a_rank_is_as_wide_as_the_tests_leave_it() {
        let rows = ranks(Some("E1"), "TSA", &["a", "b", "c"], &[("a", "c")]);
        let found: Vec<(usize, usize)> = rows.iter().map(|row| (row.best, row.worst)).collect();
        assert_eq!(found, [(1, 2), (1, 3), (2, 3)]);
    }
}
