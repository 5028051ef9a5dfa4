//! The lists: one line per cell, flip or expression.

use indexmap::IndexMap;

use super::{Limit, words};
use crate::cells::diff::{Changes, Flip, Rewritten};
use crate::tables::{Column, Look, Table};
use exact::escape::visible;

pub(super) fn rewritten(all: &[Rewritten], limit: Limit, width: Option<usize>) -> Option<String> {
    let written = |text: &Option<String>| text.as_ref().map_or_else(|| "(none)".to_owned(), |text| visible(text));
    let rows = all.iter().map(|one| {
        [visible(&one.name), one.part.to_owned(), written(&one.text.before), written(&one.text.after)].to_vec()
    });
    let header = ["name", "part", "before", "after"].map(str::to_owned).to_vec();
    List { header, names: 2, rows, count: all.len() }.render(limit, width)
}

pub(super) fn cells(changes: &Changes, limit: Limit, width: Option<usize>) -> Option<String> {
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
    List { header, names: changes.by.len() + 1, rows, count: changes.cells.len() }.render(limit, width)
}

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

pub(super) fn flips(flips: &[Flip], limit: Limit, width: Option<usize>) -> Option<String> {
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
    List { header, names: 4, rows, count: flips.len() }.render(limit, width)
}

struct List<R> {
    header: Vec<String>,
    names: usize,
    rows: R,
    count: usize,
}

impl<R: Iterator<Item = Vec<String>>> List<R> {
    /// The list, cut at the limit; `None` without lines.
    fn render(self, limit: Limit, width: Option<usize>) -> Option<String> {
        let rest = words::left_out(self.count, limit);
        match (self.count, limit) {
            (0, _) => return None,
            (_, Limit(0)) => return rest.map(|rest| format!("  {rest}")),
            _ => {}
        }
        let table = Table::list(Look::Ruled, self.names, self.header.into_iter().map(Column::left));
        let table = table.with(self.rows.take(limit.0)).within(width);
        Some(rest.map_or_else(|| table.trim_end_matches('\n').to_owned(), |rest| format!("{table}  {rest}")))
    }
}
