//! An audit as text: the infeasible cells, the reasons, one line per table, a summary line.

use std::fmt::Write as _;

use super::{Audit, AuditedTable, InfeasibleCell};
use crate::tables::{Column, Look, Table, push_wrapped};
use exact::escape::visible;
use exact::rounding::Rounding;

const NAMES: usize = 4;

impl Audit {
    pub fn render(&self, width: Option<usize>) -> String {
        let audit = self;
        let mut text = String::new();
        if !audit.infeasible.is_empty() {
            push_cells(&mut text, audit, width);
            text.push('\n');
        }
        for zero in &audit.undefined_as_zero {
            let cell = &zero.cell;
            let [experiment, model, metric] = [&cell.experiment, &cell.model, &cell.metric].map(|name| visible(name));
            let words = format!(
                "note: {}, {experiment}, {model}, {metric}: the table prints zero although no episode counts, as the style `{}` does",
                visible(&zero.table),
                visible(&audit.style)
            );
            push_wrapped(&mut text, &words, width, 2);
        }
        for table in &audit.tables {
            push_wrapped(&mut text, &summary(table), width, 2);
        }
        if audit.unbounded_errors > 0 {
            let words = format!(
                "note: {} standard errors are of durations or other whole numbers, which give almost any: a wrong one is seldom found",
                audit.unbounded_errors
            );
            push_wrapped(&mut text, &words, width, 2);
        }
        let _ = writeln!(text, "{} of {} cells are feasible", audit.feasible, audit.cells);
        text
    }
}

fn push_cells(text: &mut String, audit: &Audit, width: Option<usize>) {
    let header = ["table", "experiment", "model", "metric", "published", "infeasible"];
    let rows = audit.infeasible.iter().enumerate().map(|(at, cell)| {
        let names = [&cell.table, &cell.cell.experiment, &cell.cell.model, &cell.cell.metric, &cell.published];
        names.map(Clone::clone).into_iter().chain([format!("{} [{}]", cell.field.name(), at + 1)])
    });
    *text += &Table::list(Look::Framed, NAMES, header.map(Column::left)).with(rows).within(width);
    for (at, cell) in audit.infeasible.iter().enumerate() {
        let number = format!("[{}] ", at + 1);
        push_wrapped(
            text,
            &format!("{number}{}{}", visible(&cell.reason), other_roundings(cell, audit)),
            width,
            number.len(),
        );
    }
}

fn other_roundings(cell: &InfeasibleCell, audit: &Audit) -> String {
    let Some(table) = audit.tables.iter().find(|table| table.table == cell.table) else { return String::new() };
    let costs = cell.feasible_rounded.iter().map(|rounding| match infeasible_under(table, *rounding) {
        1 => format!("{}, with 1 other cell infeasible", rounding.name()),
        others => format!("{}, with {others} other cells infeasible", rounding.name()),
    });
    let costs: Vec<String> = costs.collect();
    if costs.is_empty() { String::new() } else { format!("; feasible in a table rounded {}", costs.join("; or ")) }
}

fn infeasible_under(table: &AuditedTable, rounding: Rounding) -> usize {
    table.roundings.iter().find(|count| count.rounding == rounding).map_or(0, |count| count.infeasible)
}

fn summary(table: &AuditedTable) -> String {
    let counts = table.roundings.iter().map(|count| format!("{} {}", count.rounding.name(), count.infeasible));
    format!(
        "{}: feasible {} of {} cells, rounded {} (infeasible numbers by rounding: {})",
        visible(&table.table),
        table.feasible,
        table.cells,
        table.rounding.name(),
        counts.collect::<Vec<_>>().join(", ")
    )
}
