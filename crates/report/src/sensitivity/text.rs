//! The answer as text: for a terminal, as Markdown, as CSV.

use super::{Sensitivity, ThresholdCell};
use crate::tables::fit::wrapped;
use crate::tables::terminal::Terminal;
use crate::tables::{csv as spreadsheet, markdown as marked, terminal};
use exact::escape::visible;
use exact::number::full_precision;

const HEADING: &str = "Where a conclusion changes";
const NONE: &str = "No conclusion changes.";

/// The room for sentences where lines may be of any length.
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
    terminal::render(&found.table, on) + &lines.join("\n") + "\n"
}

pub(super) fn markdown(found: &Sensitivity) -> String {
    let text = marked::render(&found.table);
    if found.changes.is_empty() {
        return text + "\n" + NONE + "\n";
    }
    let sentences: Vec<String> =
        found.changes.iter().map(|change| format!("- {}\n", marked::escape(&change.sentence))).collect();
    text + "\n**" + HEADING + ".**\n\n" + &sentences.concat()
}

pub(super) fn csv(found: &Sensitivity) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    let tail = ["threshold", "metric", "n", "sum", "mean", "se"].map(str::to_owned);
    spreadsheet::write(&mut writer, found.by.iter().cloned().chain(tail));
    for cell in &found.cells {
        spreadsheet::write(&mut writer, record(found, cell));
    }
    spreadsheet::finish(writer)
}

fn record(found: &Sensitivity, cell: &ThresholdCell) -> Vec<String> {
    let word = || found.reference.split(' ').next().unwrap_or_default().to_owned();
    let number = |value: Option<f64>| value.map(full_precision).unwrap_or_default();
    let keys = cell.key.values().map(spreadsheet::key_field);
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
