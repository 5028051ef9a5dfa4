//! Emphasis that contradicts the printed means, under a style that derives emphasis from them.

use std::collections::BTreeMap;

use super::{InfeasibleCell, NamedTable, Terms};
use crate::errata::Field;
use crate::layout::emphasis::emphasise;
use crate::layout::{MetricCell, Value};
use crate::published::PrintedCell;
use crate::style::{EmphasisRule, TableSheet};
use crate::tables::Emphasis;
use exact::moments::Moments;

/// The cells of a table whose emphasis differs from what their printed means imply, by position.
///
/// Empty for a table that the style lacks or does not emphasise by printed means, and for one without any emphasis.
pub(super) fn infeasible(
    table: &NamedTable,
    sheet: Option<&TableSheet>,
    terms: Terms<'_>,
) -> Vec<(usize, InfeasibleCell)> {
    let by_print = |sheet: &TableSheet| terms.style.sheet.print_of(sheet).emphasis == EmphasisRule::PrintedMean;
    let cells = &table.published.cells;
    let is_plain = cells.iter().all(|(_, cell)| cell.emphasis == Emphasis::Plain);
    if is_plain || !sheet.is_some_and(by_print) {
        return Vec::new();
    }
    let mut columns: BTreeMap<(&str, &str), Vec<usize>> = BTreeMap::new();
    for (at, (name, _)) in cells.iter().enumerate() {
        columns.entry((&name.experiment, &name.metric)).or_default().push(at);
    }
    let mut found = Vec::new();
    for ((_, metric), places) in columns {
        let expected = expected(places.iter().map(|at| &cells[*at].1), metric, terms);
        let differing = places.into_iter().zip(expected).filter(|(at, expected)| cells[*at].1.emphasis != *expected);
        found.extend(differing.map(|(at, expected)| (at, told(table, at, expected))));
    }
    found
}

fn expected<'c>(cells: impl Iterator<Item = &'c PrintedCell>, metric: &str, terms: Terms<'_>) -> Vec<Emphasis> {
    let value = |cell: &PrintedCell| cell.mean.map_or(Value::Undefined, |mean| Value::MeanSe { mean, se: cell.se });
    let mut cells: Vec<MetricCell> = cells.map(|cell| MetricCell::plain(value(cell), &Moments::default(), 0)).collect();
    let better = terms.style.sheet.better(metric, terms.catalog);
    emphasise(&mut cells.iter_mut().collect::<Vec<_>>(), better, EmphasisRule::PrintedMean);
    cells.into_iter().map(|cell| cell.emphasis).collect()
}

fn told(table: &NamedTable, at: usize, expected: Emphasis) -> InfeasibleCell {
    let word = |emphasis: Emphasis| match emphasis {
        Emphasis::Plain => "plain",
        Emphasis::Bold => "bold",
        Emphasis::Underline => "underlined",
    };
    let (name, cell) = &table.published.cells[at];
    let (found, expected) = (word(cell.emphasis), word(expected));
    let mean = cell.mean.map_or_else(|| "--".to_owned(), |mean| mean.to_string());
    InfeasibleCell {
        table: table.name.clone(),
        cell: name.clone(),
        published: format!("{} {found}", super::reason::shown(cell.mean, cell.se)),
        field: Field::Emphasis,
        reason: format!("{found}, but by the rule of the style the printed mean {mean} is {expected} in its column"),
        nearest: vec![expected.to_owned()],
        feasible_rounded: Vec::new(),
    }
}
