//! Checks the cells of published tables by arithmetic, one by one: those that no integers can print.
//!
//! Rule: feasible only means that arithmetic does not exclude the cell, under any of the roundings.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use schemars::JsonSchema;
use serde::Serialize;

use crate::published::errata::Field;
use crate::published::{CellLabel, PrintedCell, Published};
use mirrorstats_exact::budget::{Budget, Exceeded, Limit};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::number::Decimal;
use mirrorstats_exact::rounding::Rounding;
use mirrorstats_exact::suggest::hint;
use mirrorstats_metric::catalogs::catalog::{Catalog, Kind, Metric};
use mirrorstats_statistics::feasible::{Print, Sample};
use mirrorstats_tables::{Column, Look, Table};

/// The most episodes of a cell: printed digits carry no information about more.
pub const MOST_EPISODES: u64 = 2_000;

/// Each takes some 20 µs.
const MOST_SUMS: Limit = Limit::new("sums that the cells of published tables are tried with", 200_000);

/// More digits would leave 128 bits.
const MOST_DIGITS: u32 = 9;

/// The findings of an audit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Audit {
    /// The episodes behind each cell.
    pub n: u64,
    /// The number of cells of the tables.
    pub cells: usize,
    /// The number of feasible cells.
    pub feasible: usize,
    /// The others, in the order of the tables.
    pub infeasible: Vec<InfeasibleCell>,
    /// The name of the definitions.
    pub definitions: String,
    /// Their hash.
    pub(crate) definitions_sha256: String,
}

/// A cell that no data can give.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct InfeasibleCell {
    /// Its table.
    pub table: String,
    /// The cell.
    #[serde(flatten)]
    pub cell: CellLabel,
    /// The published text.
    pub published: String,
    /// The infeasible field: `mean`, or `se` beside the mean.
    pub field: Field,
    /// The nearest feasible means, below and above; empty if the mean is feasible.
    pub nearest: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AuditError {
    #[error("{table}: the definitions `{definitions}` have no metric `{metric}`{hint}")]
    UnknownMetric { table: String, definitions: String, metric: String, hint: String },
    #[error("{table}: expected a number of at most {MOST_DIGITS} digits, found `{found}`")]
    TooManyDigits { table: String, found: String },
    #[error(transparent)]
    Exceeded(#[from] Exceeded),
}

/// Audits tables of `n` episodes per cell; fewer may count for a metric with a condition. Any of the roundings may have
/// printed a cell.
pub fn audit(
    tables: &[(String, Published)],
    catalog: &Catalog,
    n: u64,
    roundings: &[Rounding],
) -> Result<Audit, AuditError> {
    let (mut cells, mut infeasible, tried) = (0, Vec::new(), Budget::new(MOST_SUMS));
    for (table, published) in tables {
        for (name, cell) in &published.cells {
            cells += 1;
            let metric = known(table, name, cell, catalog)?;
            let Some(mean) = cell.mean else { continue };
            let question = CellQuestion { mean, se: cell.se, metric, n, roundings };
            let Some((field, nearest)) = question.fault(&tried)? else { continue };
            let published = cell.se.map_or_else(|| mean.to_string(), |se| format!("{mean} ± {se}"));
            infeasible.push(InfeasibleCell { table: table.clone(), cell: name.clone(), published, field, nearest });
        }
    }
    let (definitions, definitions_sha256) = (catalog.name.clone(), catalog.hash.clone());
    Ok(Audit { n, cells, feasible: cells - infeasible.len(), infeasible, definitions, definitions_sha256 })
}

fn known<'c>(
    table: &str,
    name: &CellLabel,
    cell: &PrintedCell,
    catalog: &'c Catalog,
) -> Result<&'c Metric, AuditError> {
    let is_long =
        |number: &Decimal| number.places() >= MOST_DIGITS || number.units().unsigned_abs() >= 10_u128.pow(MOST_DIGITS);
    if let Some(number) = [cell.mean, cell.se].into_iter().flatten().find(is_long) {
        let table = visible(&format!("{table}: {}, {}, {}", name.experiment, name.model, name.metric));
        return Err(AuditError::TooManyDigits { table, found: number.to_string() });
    }
    catalog.metric.get(&name.metric).ok_or_else(|| AuditError::UnknownMetric {
        table: visible(table),
        definitions: visible(&catalog.name),
        metric: visible(&name.metric),
        hint: hint(&name.metric, catalog.metric.keys().map(String::as_str)),
    })
}

struct CellQuestion<'q> {
    mean: Decimal,
    se: Option<Decimal>,
    metric: &'q Metric,
    n: u64,
    roundings: &'q [Rounding],
}

impl CellQuestion<'_> {
    /// The infeasible field of the cell, and the nearest feasible means.
    fn fault(&self, tried: &Budget) -> Result<Option<(Field, Vec<String>)>, Exceeded> {
        let (mut below, mut above, mut has_mean) = (BTreeSet::new(), BTreeSet::new(), false);
        let fewest = if self.metric.when.is_some() { 1 } else { self.n };
        let is_rate = self.metric.kind == Kind::Rate;
        for n in fewest..=self.n {
            let sample = Sample { n, is_rate, form: self.metric.se };
            for &rounding in self.roundings {
                tried.spend(1)?;
                let print = Print { mean: self.mean, se: self.se, rounding };
                let sums = sample.sums(&print);
                if sample.has_spread(sums, &print, tried)? {
                    return Ok(None);
                }
                has_mean |= sums.0 <= sums.1;
                let [low, high] = sample.means_beside(&print);
                below.extend(low.map(Decimal::units));
                above.extend(high.map(Decimal::units));
            }
        }
        if has_mean {
            return Ok(Some((Field::Se, Vec::new())));
        }
        let nearest = below.last().into_iter().chain(above.first());
        let shown = nearest.map(|units| Decimal::of_units(*units, self.mean.places()).to_string());
        Ok(Some((Field::Mean, shown.collect())))
    }
}

impl Audit {
    pub fn holds(&self) -> bool {
        self.infeasible.is_empty()
    }

    pub fn render(&self, width: Option<usize>) -> String {
        let mut text = String::new();
        if !self.infeasible.is_empty() {
            let header = ["table", "experiment", "model", "metric", "published", "infeasible", "nearest means"];
            let rows = self.infeasible.iter().map(|found| {
                let CellLabel { experiment, model, metric } = &found.cell;
                let names = [&found.table, experiment, model, metric, &found.published].map(Clone::clone);
                names.into_iter().chain([found.field.name().to_owned(), found.nearest.join(", ")])
            });
            text = Table::list(Look::Framed, 4, header.map(Column::left)).with(rows).within(width) + "\n";
        }
        let Self { cells, feasible, n, .. } = self;
        let _ = writeln!(text, "{feasible} of {cells} cells are feasible with n = {n}");
        text
    }
}
