//! The answer as text: for a terminal, as Markdown, as CSV.

use super::{Sensitivity, ThresholdCell};
use crate::tables::{Table, Terminal, escape_markdown, key_field, wrapped};
use exact::escape::visible;
use exact::number::full_precision;

const HEADING: &str = "Where a conclusion changes";
const NONE: &str = "No conclusion changes.";

/// The width of sentences if lines are not limited.
const ROOM: usize = 110;

pub(super) fn render(found: &Sensitivity, on: Terminal) -> String {
    let mut lines = vec![String::new()];
    if found.changes.is_empty() {
        lines.push(NONE.to_owned());
    } else {
        lines.push(HEADING.to_owned());
        let sentences = found.changes.iter().map(|change| format!("- {}", visible(&change.sentence)));
        lines.extend(sentences.flat_map(|sentence| wrapped(&sentence, on.width.unwrap_or(ROOM), 2)));
    }
    found.table.printed().terminal(on) + &lines.join("\n") + "\n"
}

pub(super) fn markdown(found: &Sensitivity) -> String {
    let text = found.table.printed().markdown();
    if found.changes.is_empty() {
        return text + "\n" + NONE + "\n";
    }
    let sentences: Vec<String> =
        found.changes.iter().map(|change| format!("- {}\n", escape_markdown(&change.sentence))).collect();
    text + "\n**" + HEADING + ".**\n\n" + &sentences.concat()
}

pub(super) fn csv(found: &Sensitivity) -> String {
    let tail = ["threshold", "metric", "n", "sum", "mean", "se"];
    let header = found.by.iter().map(String::as_str).chain(tail);
    Table::of_texts(header).with(found.cells.iter().map(|cell| record(found, cell))).csv()
}

fn record(found: &Sensitivity, cell: &ThresholdCell) -> Vec<String> {
    let word = || found.reference.split(' ').next().unwrap_or_default().to_owned();
    let number = |value: Option<f64>| value.map(full_precision).unwrap_or_default();
    let keys = cell.key.values().map(key_field);
    keys.chain([
        cell.threshold.map_or_else(word, |px| px.to_string()),
        cell.metric.clone(),
        cell.n.to_string(),
        if cell.n == 0 { String::new() } else { cell.sum.to_string() },
        number(cell.mean),
        number(cell.se),
    ])
    .collect()
}
