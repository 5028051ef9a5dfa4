//! The lists: one line a cell, a flip, an expression.

use comfy_table::{LineStyle, Table, presets};
use indexmap::IndexMap;

use super::{Limit, words};
use crate::base::visible::visible;
use crate::cells::changes::{Changes, Flip, Rewritten};

/// Expressions that are not written the same.
pub(super) fn rewritten(all: &[Rewritten], limit: Limit) -> Option<String> {
    let written = |text: &Option<String>| text.as_ref().map_or_else(|| "(none)".to_owned(), |text| visible(text));
    let rows = all.iter().map(|one| {
        [visible(&one.name), one.part.to_owned(), written(&one.text.before), written(&one.text.after)].to_vec()
    });
    listed(["name", "part", "before", "after"].map(str::to_owned).to_vec(), rows, all.len(), limit)
}

/// The cells that moved.
pub(super) fn cells(changes: &Changes, limit: Limit) -> Option<String> {
    let header = changes.by.iter().map(|name| visible(name));
    let header = header.chain(["metric", "n", "mean", "change", "se"].map(str::to_owned)).collect();
    let rows = changes.cells.iter().map(|cell| {
        let fields = [
            visible(&cell.metric),
            words::n(&cell.numbers),
            words::mean(&cell.numbers),
            words::mean_change(cell),
            words::se(&cell.numbers),
        ];
        cell.key.values().map(words::key).chain(fields).collect()
    });
    listed(header, rows, changes.cells.len(), limit)
}

/// How often each metric went from which value to which: `0 -> 1`; a quantity may only rise or fall.
pub(super) fn flips_by_metric(flips: &[Flip]) -> Option<String> {
    let mut counts: IndexMap<&str, IndexMap<&str, usize>> = IndexMap::new();
    for flip in flips {
        *counts.entry(&flip.metric).or_default().entry(direction(flip)).or_default() += 1;
    }
    let lines = counts.into_iter().map(|(metric, mut directions)| {
        directions.sort_keys();
        let parts: Vec<String> = directions.iter().map(|(direction, count)| format!("{count} {direction}")).collect();
        format!("  {}: {}", visible(metric), parts.join(", "))
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    (!text.is_empty()).then_some(text)
}

fn direction(flip: &Flip) -> &'static str {
    match (flip.value.before, flip.value.after) {
        (Some(before), Some(after)) if after > before => "up",
        (Some(_), Some(_)) => "down",
        (None, _) => "from undefined",
        (_, None) => "to undefined",
    }
}

/// The episodes that flipped, with the timesteps that decided where some are known.
pub(super) fn flips(flips: &[Flip], limit: Limit) -> Option<String> {
    let explained = flips.iter().any(|flip| flip.timesteps.before.is_some() || flip.timesteps.after.is_some());
    let mut header = ["metric", "experiment", "model", "episode", "before", "after"].map(str::to_owned).to_vec();
    if explained {
        header.extend(["decided before at", "decided after at"].map(str::to_owned));
    }
    let rows = flips.iter().map(|flip| {
        let name = &flip.episode;
        let mut row: Vec<String> =
            [&flip.metric, &name.experiment, &name.model, &name.episode_id].map(|text| visible(text)).to_vec();
        row.extend([flip.value.before, flip.value.after].map(words::value));
        if explained {
            row.extend([&flip.timesteps.before, &flip.timesteps.after].map(|steps| words::timesteps(steps.as_ref())));
        }
        row
    });
    listed(header, rows, flips.len(), limit)
}

/// A list under its header, cut at the limit; `None` for no line.
fn listed(header: Vec<String>, rows: impl Iterator<Item = Vec<String>>, count: usize, limit: Limit) -> Option<String> {
    let rest = words::left_out(count, limit);
    match (count, limit) {
        (0, _) => return None,
        (_, Limit(0)) => return rest.map(|rest| format!("  {rest}")),
        _ => {}
    }
    let mut table = Table::new();
    table.load_style(presets::NOTHING.header_separator(LineStyle::none().fill('─').junction('─')));
    table.set_header(header).add_rows(rows.take(limit.0));
    let rest = rest.map_or_else(String::new, |rest| format!("\n  {rest}"));
    Some(format!("{}{rest}", table.trim_fmt()))
}
