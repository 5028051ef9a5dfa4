//! Rates against the doses of a factor, for each model: do they rise or fall?

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::statistics::comparisons::matching::selection;
use crate::statistics::rates::chance::Verdict;
use crate::study::{Block, Study, Unit};
use mirrorstats_metric::catalogs::catalog::Factor;
use mirrorstats_score::tables::table::MetricColumn;
use mirrorstats_statistics::comparisons::holm::{holm, is_significant};
use mirrorstats_statistics::comparisons::trend::{Trend, cochran_armitage};

/// A rate of one model at the doses of a factor, and the test of no trend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TrendRow {
    /// The factor of the definitions.
    pub factor: String,
    /// Its unit; empty without one.
    pub unit: String,
    /// The metric.
    pub metric: String,
    /// The model.
    pub model: String,
    /// The condition, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// The rate at each dose, from the least to the largest.
    pub doses: Vec<Dose>,
    /// What episodes at different doses are compared within: `scenes`, `seeds`, `participants`, or `episodes` where they are
    /// independent.
    pub units: String,
    /// The setting in which the recordings differ besides; then there is no test.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub incomparable: Option<String>,
    /// The Cochran-Armitage test, stratified by the units; null where there is nothing to compare.
    pub trend: Option<Trend>,
    /// Its p value adjusted by Holm's method over the models, under the same factor and metric; null for fewer than 12 units.
    pub p_adjusted: Option<f64>,
    /// `above` where the rate is shown to rise with the dose, `below` where it falls.
    pub verdict: Verdict,
}

/// A rate at one dose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Dose {
    /// The value of the factor.
    pub dose: f64,
    /// The experiment.
    pub experiment: String,
    /// The successes.
    pub successes: u64,
    /// The episodes in which the metric is defined.
    pub n: u64,
    /// The mean over units, each counted once, as in the test; null if each episode is its own unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit_mean: Option<f64>,
}

/// The fewest scenes, other units or independent episodes for which the asymptotic test is valid.
const LEAST_UNITS: u64 = 12;

impl TrendRow {
    /// The number of compared units, if it is too small for a verdict.
    pub(crate) fn too_few(&self) -> Option<u64> {
        let episodes = || self.doses.iter().map(|dose| dose.n).sum();
        let units = self.trend.map(|trend| if self.units == "episodes" { episodes() } else { trend.strata });
        units.filter(|units| *units < LEAST_UNITS)
    }

    /// The headline rates under every factor with two or more experiments in the table.
    pub(crate) fn all(study: &Study, headline: &[String]) -> Vec<Self> {
        let mut rows = Vec::new();
        for (name, factor) in &study.table.catalog.factor {
            let blocks = blocks(study, factor);
            for column in study.rates().filter(|column| headline.contains(&column.name)) {
                let of_model = blocks.values().filter(|blocks| blocks.len() > 1);
                let mut family: Vec<Self> =
                    of_model.map(|blocks| Self::of(study, (name, factor), blocks, column)).collect();
                adjust(&mut family, study.confidence);
                rows.extend(family);
            }
        }
        rows
    }

    fn of(study: &Study, (name, factor): (&str, &Factor), blocks: &[(f64, &Block)], column: &MetricColumn) -> Self {
        let (mut strata, mut doses) = (BTreeMap::<Option<Unit>, Vec<(f64, f64)>>::new(), Vec::new());
        let first = blocks[0].1;
        for (dose, block) in blocks {
            let (successes, n) = block.moments(column).counts().unwrap_or_default();
            let unit_mean = block.repeats.then(|| study.mean(block, column)).flatten();
            doses.push(Dose { dose: *dose, experiment: block.experiment.to_owned(), successes, n, unit_mean });
            for (unit, moments) in study.by_unit(block, |row| column.get(row)) {
                // Episodes without a shared unit form one stratum.
                let unit = Some(unit).filter(|unit| !matches!(unit, Unit::Episode(_)));
                strata.entry(unit).or_default().extend(moments.mean().map(|mean| (*dose, mean)));
            }
        }
        let incomparable = blocks.iter().find_map(|(_, block)| {
            study.incomparable(first, block).or_else(|| selection(study, column, [first, block]))
        });
        let strata: Vec<_> = strata.into_values().collect();
        Self {
            factor: name.to_owned(),
            unit: factor.unit.clone(),
            metric: column.name.clone(),
            model: first.model.to_owned(),
            condition: first.condition(),
            doses,
            units: study.unit_name(first).to_owned(),
            trend: cochran_armitage(&strata).filter(|_| incomparable.is_none()),
            incomparable,
            p_adjusted: None,
            verdict: Verdict::NotSeparated,
        }
    }
}

type Blocks<'s, 'a> = BTreeMap<(&'a str, Option<&'a str>), Vec<(f64, &'s Block<'a>)>>;

/// The blocks of each model and condition, ascending by dose.
fn blocks<'s, 'a>(study: &'s Study<'a>, factor: &Factor) -> Blocks<'s, 'a> {
    let mut found = Blocks::new();
    for (experiment, dose) in factor.doses() {
        for block in study.blocks().filter(|block| block.experiment == experiment) {
            found.entry((block.model, block.condition)).or_default().push((dose, block));
        }
    }
    found
}

fn adjust(family: &mut [TrendRow], confidence: f64) {
    let tested: Vec<&mut TrendRow> =
        family.iter_mut().filter(|row| row.trend.is_some() && row.too_few().is_none()).collect();
    let adjusted = holm(&tested.iter().filter_map(|row| Some(row.trend?.p)).collect::<Vec<_>>());
    for (row, p) in tested.into_iter().zip(adjusted) {
        row.p_adjusted = Some(p);
        let z = row.trend.map_or(0.0, |trend| trend.z);
        row.verdict = Verdict::by_order(z.total_cmp(&0.0), is_significant(p, confidence));
    }
}
