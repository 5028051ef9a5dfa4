//! Checks published tables by arithmetic: the cells that no data can give, and why.
//!
//! Rule: a cell is infeasible only if no integers print it, under the definitions, the number of episodes and the
//! rounding of its table. A table has one rounding, the one with the fewest infeasible cells. Cells that are not
//! printed are unconstrained, so feasible only means that arithmetic does not exclude the cell.

mod emphasis;
pub mod episodes;
mod error;
mod reason;
mod row;
pub mod text;

use std::collections::BTreeMap;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Serialize;

use self::episodes::Episodes;
pub use self::error::AuditError;
use self::row::{Definitions, Row, RowCell};
use crate::errata::Field;
use crate::published::{CellLabel, Published};
use crate::style::{Style, TableSheet};
use exact::rounding::Rounding;
use metric::catalog::{Catalog, Kind};
use metric::implied::Implied;
use statistics::feasible::attain::Search;

#[derive(Clone, Copy, Debug)]
pub struct Terms<'t> {
    pub catalog: &'t Catalog,
    pub implied: &'t IndexMap<String, Implied>,
    pub episodes: &'t Episodes,
    pub style: &'t Style,
    /// The roundings to consider; at least one.
    pub roundings: &'t [Rounding],
}

#[derive(Clone, Debug)]
pub struct NamedTable {
    /// The name of its file, without a path.
    pub name: String,
    pub published: Published,
}

/// The findings of an audit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Audit {
    /// The number of cells of the tables.
    pub cells: usize,
    /// The number of feasible cells.
    pub feasible: usize,
    /// The others, in the order of the tables.
    pub infeasible: Vec<InfeasibleCell>,
    /// Cells that print zero where no episode counts, as the style says that their table does.
    pub undefined_as_zero: Vec<ZeroCell>,
    /// Printed standard errors of durations and other quantities: whole numbers give almost any, so that a wrong one is seldom found.
    pub(crate) unbounded_errors: usize,
    /// Each table.
    pub tables: Vec<AuditedTable>,
    /// The name of the definitions.
    pub definitions: String,
    /// Their hash.
    pub(crate) definitions_sha256: String,
    /// The name of the style.
    pub style: String,
}

/// A table of an audit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct AuditedTable {
    /// The name of its file.
    pub table: String,
    /// The number of its cells.
    pub cells: usize,
    /// The number of its feasible cells.
    pub feasible: usize,
    /// The rounding that it is taken to have.
    pub rounding: Rounding,
    /// Each rounding considered, with the cells whose numbers would be infeasible under it.
    pub roundings: Vec<RoundingCount>,
}

/// A rounding that was considered for a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct RoundingCount {
    /// The rounding.
    pub rounding: Rounding,
    /// The number of the table's infeasible cells under this assumption.
    pub infeasible: usize,
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
    /// The infeasible field of the cell.
    pub field: Field,
    /// The reason why, in a sentence.
    pub reason: String,
    /// The nearest feasible prints, below and above.
    pub nearest: Vec<String>,
    /// Other roundings under which the cell alone is feasible, and with which more cells of its table are not.
    pub(crate) feasible_rounded: Vec<Rounding>,
}

/// A cell whose zero represents an undefined value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ZeroCell {
    /// Its table.
    pub table: String,
    /// The cell.
    #[serde(flatten)]
    pub cell: CellLabel,
}

impl Audit {
    pub fn holds(&self) -> bool {
        self.infeasible.is_empty()
    }
}

/// Audits tables of one study: equal cells of two tables must come from the same data.
pub fn audit(tables: &[NamedTable], terms: Terms<'_>) -> Result<Audit, AuditError> {
    error::check(tables, terms)?;
    let mut auditor = Auditor { tables, terms, search: Search::default() };
    let roundings: Vec<Vec<RoundingCount>> = (0..tables.len()).map(|at| auditor.roundings_of(at)).collect();
    let chosen = auditor.chosen(&roundings);
    let (mut found, zeros) = auditor.infeasible(&chosen);
    for (at, table) in tables.iter().enumerate() {
        for (cell, infeasible) in emphasis::infeasible(table, auditor.sheet(at), terms) {
            found.entry((at, cell)).or_insert(infeasible);
        }
    }
    let audited = chosen.into_iter().zip(roundings).collect();
    Ok(summed_up(tables, terms, found, &zeros, audited))
}

type Found = BTreeMap<(usize, usize), InfeasibleCell>;

fn summed_up(
    tables: &[NamedTable],
    terms: Terms<'_>,
    found: Found,
    zeros: &[(usize, usize)],
    audited: Vec<(Rounding, Vec<RoundingCount>)>,
) -> Audit {
    let cells = tables.iter().map(|table| table.published.cells.len()).sum();
    let audited = tables.iter().zip(audited).enumerate().map(|(at, (table, (rounding, roundings)))| AuditedTable {
        table: table.name.clone(),
        cells: table.published.cells.len(),
        feasible: table.published.cells.len() - found.keys().filter(|(of, _)| *of == at).count(),
        rounding,
        roundings,
    });
    let zero = |&(table, cell): &(usize, usize)| ZeroCell {
        table: tables[table].name.clone(),
        cell: tables[table].published.cells[cell].0.clone(),
    };
    let is_quantity =
        |metric: &str| terms.catalog.metric.get(metric).is_some_and(|metric| metric.kind == Kind::Quantity);
    let printed = tables.iter().flat_map(|table| &table.published.cells);
    let unbounded_errors = printed.filter(|(name, cell)| cell.se.is_some() && is_quantity(&name.metric)).count();
    Audit {
        cells,
        unbounded_errors,
        feasible: cells - found.len(),
        undefined_as_zero: zeros.iter().map(zero).collect(),
        tables: audited.collect(),
        infeasible: found.into_values().collect(),
        definitions: terms.catalog.name.clone(),
        definitions_sha256: terms.catalog.hash.clone(),
        style: terms.style.name.clone(),
    }
}

fn fewest(counts: &[RoundingCount]) -> Vec<Rounding> {
    let least = counts.iter().map(|count| count.infeasible).min();
    counts.iter().filter(|count| Some(count.infeasible) == least).map(|count| count.rounding).collect()
}

struct Auditor<'t> {
    tables: &'t [NamedTable],
    terms: Terms<'t>,
    search: Search,
}

impl<'t> Auditor<'t> {
    fn definitions(&self) -> Definitions<'t> {
        Definitions { catalog: self.terms.catalog, implied: self.terms.implied }
    }

    fn sheet(&self, table: usize) -> Option<&'t TableSheet> {
        let metrics = || self.tables[table].published.cells.iter().map(|(cell, _)| &cell.metric);
        self.terms.style.sheet.table.values().find(|sheet| metrics().all(|metric| sheet.columns.contains(metric)))
    }

    fn roundings_of(&mut self, table: usize) -> Vec<RoundingCount> {
        let roundings = self.terms.roundings;
        let count =
            |&rounding: &Rounding| RoundingCount { rounding, infeasible: self.infeasible_in(&[(table, rounding)]) };
        roundings.iter().map(count).collect()
    }

    /// The rounding of each table: the first with the fewest infeasible cells, unless an equally good one leaves fewer
    /// infeasible cells over all tables.
    fn chosen(&mut self, roundings: &[Vec<RoundingCount>]) -> Vec<Rounding> {
        let tied: Vec<Vec<Rounding>> = roundings.iter().map(|counts| fewest(counts)).collect();
        let mut chosen: Vec<Rounding> = tied.iter().map(|tied| tied[0]).collect();
        let mut least = self.infeasible_in_all(&chosen);
        for (at, tied) in tied.iter().enumerate() {
            for rounding in tied {
                let mut other = chosen.clone();
                other[at] = *rounding;
                let count = if least == 0 || other == chosen { least } else { self.infeasible_in_all(&other) };
                if count < least {
                    (chosen, least) = (other, count);
                }
            }
        }
        chosen
    }

    fn infeasible_in_all(&mut self, roundings: &[Rounding]) -> usize {
        let tables: Vec<(usize, Rounding)> = roundings.iter().copied().enumerate().collect();
        self.infeasible_in(&tables)
    }

    fn infeasible_in(&mut self, tables: &[(usize, Rounding)]) -> usize {
        let (rows, definitions) = (self.rows(tables), self.definitions());
        rows.values().map(|row| row.solve(definitions, &mut self.search).refused.len()).sum()
    }

    fn rows(&self, tables: &[(usize, Rounding)]) -> IndexMap<(&'t str, &'t str), Row> {
        let mut rows: IndexMap<(&str, &str), Row> = IndexMap::new();
        for &(table, rounding) in tables {
            let zeros = self.sheet(table).map(|sheet| sheet.undefined_as_zero.as_slice()).unwrap_or_default();
            for (at, (name, cell)) in self.tables[table].published.cells.iter().enumerate() {
                let row = rows.entry((name.experiment.as_str(), name.model.as_str())).or_default();
                row.n = self.terms.episodes.of(&name.experiment, &name.model).unwrap_or_default();
                let zero_may_be_undefined = zeros.contains(&name.metric);
                let cell = RowCell { at: (table, at), cell: *cell, rounding, zero_may_be_undefined };
                row.metrics.entry(name.metric.clone()).or_default().push(cell);
            }
        }
        rows
    }

    fn infeasible(&mut self, roundings: &[Rounding]) -> (Found, Vec<(usize, usize)>) {
        let tables: Vec<(usize, Rounding)> = roundings.iter().copied().enumerate().collect();
        let (mut found, mut zeros) = (Found::new(), Vec::new());
        for row in self.rows(&tables).values() {
            let solved = row.solve(self.definitions(), &mut self.search);
            zeros.extend(solved.zeros);
            for refused in solved.refused {
                found.insert(refused.cell.at, self.told(row, &refused));
            }
        }
        zeros.sort_unstable();
        (found, zeros)
    }

    fn told(&mut self, row: &Row, refused: &row::Refused) -> InfeasibleCell {
        let (table, at) = refused.cell.at;
        let definitions = self.definitions();
        let reason = reason::reason(row, refused, definitions, &mut self.search);
        let others = self.terms.roundings.iter().copied().filter(|rounding| *rounding != refused.cell.rounding);
        let feasible_rounded =
            others.filter(|rounding| refused.is_feasible(row, *rounding, definitions, &mut self.search)).collect();
        InfeasibleCell {
            table: self.tables[table].name.clone(),
            cell: self.tables[table].published.cells[at].0.clone(),
            published: reason::shown(refused.cell.cell.mean, refused.cell.cell.se),
            field: reason.field,
            reason: reason.words,
            nearest: reason.nearest,
            feasible_rounded,
        }
    }
}

#[cfg(test)]
mod tests;
