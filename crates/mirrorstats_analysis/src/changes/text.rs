//! Changes from one scoring to another, as text.
//!
//! Rule: a shortened list says how many lines are missing; a number comes with its exact counts.

use std::fmt::Write as _;

use indexmap::IndexMap;

use super::{CellChange, Changes, DefinitionsName, Flip, Numbers, Overlap, Pair, Rewritten};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::number::Decimal;
use mirrorstats_score::cells::KeyValue;
use mirrorstats_score::evidence::ranges;
use mirrorstats_tables::{Column, Look, Table};

const SHORT_HASH: usize = 12;
/// Decimal places: enough to show one episode in a thousand.
const PLACES: u32 = 3;
const MOST_RUNS: usize = 6;
const UNDEFINED: &str = "undefined";

impl Changes {
    /// The whole answer of `diff`, with tables at most `width` columns wide; the last line is a summary.
    pub fn render(&self, limit: usize, width: Option<usize>) -> String {
        let mut text = String::new();
        let names = &self.definitions;
        let _ = writeln!(text, "before: {}\nafter:  {}", origin(&names.before), origin(&names.after));
        push_section(&mut text, "Written differently", rewritten(&self.rewritten, limit, width));
        push_alone(&mut text, "metric", &self.metrics, limit, |name| visible(name));
        push_alone(&mut text, "episode", &self.episodes, limit, |name| visible(&name.episode_id));
        push_section(&mut text, "Cells that moved", moved_cells(self, limit, width));
        push_section(&mut text, "Values that flipped, by metric", flips_by_metric(&self.flips));
        push_section(&mut text, "Episodes that flipped", flips(&self.flips, limit, width));
        let _ = writeln!(text, "\n{}", sum(self));
        text
    }
}

fn origin(name: &DefinitionsName) -> String {
    let hash = name.sha256.get(..SHORT_HASH).unwrap_or(&name.sha256);
    format!("{} ({hash})", visible(&name.name))
}

fn push_section(text: &mut String, title: &str, section: Option<String>) {
    if let Some(section) = section {
        let _ = writeln!(text, "\n{title}\n{section}");
    }
}

fn push_alone<T>(text: &mut String, noun: &str, overlap: &Overlap<T>, limit: usize, name: impl Fn(&T) -> String) {
    for (side, alone) in [("before", &overlap.only_before), ("after", &overlap.only_after)] {
        if !alone.is_empty() {
            let names: Vec<String> = alone.iter().take(limit).map(&name).collect();
            let rest = left_out(alone.len(), limit).map_or_else(String::new, |rest| format!("; {rest}"));
            let _ = writeln!(text, "\nOnly {side}: {}: {}{rest}", counted(alone.len() as u64, noun), names.join(", "));
        }
    }
}

fn sum(changes: &Changes) -> String {
    let over = format!(
        "{} in both, {} in both",
        counted(changes.episodes.both, "episode"),
        counted(changes.metrics.both, "metric")
    );
    if changes.is_empty() {
        return format!("Nothing changed: {over}, {} compared.", counted(changes.cells_compared, "cell"));
    }
    format!(
        "{} of {} moved; {} in {}; {over}.",
        changes.cells.len(),
        counted(changes.cells_compared, "cell"),
        counted(changes.flips.len() as u64, "flip"),
        counted(changes.flipped_episodes().len() as u64, "episode"),
    )
}

fn rewritten(all: &[Rewritten], limit: usize, width: Option<usize>) -> Option<String> {
    let written = |text: &Option<String>| text.as_ref().map_or_else(|| "(none)".to_owned(), |text| visible(text));
    let rows = all.iter().map(|one| {
        [visible(&one.name), one.part.to_owned(), written(&one.text.before), written(&one.text.after)].to_vec()
    });
    let header = ["name", "part", "before", "after"].map(str::to_owned).to_vec();
    list(header, 2, rows, limit, width)
}

fn moved_cells(changes: &Changes, limit: usize, width: Option<usize>) -> Option<String> {
    let header = changes.by.iter().map(|name| visible(name));
    let header = header.chain(["metric", "n", "mean", "change", "se"].map(str::to_owned)).collect();
    let rows = changes.cells.iter().map(|cell| {
        let fields =
            [visible(&cell.metric), n(&cell.numbers), mean(&cell.numbers), mean_change(cell), se(&cell.numbers)];
        cell.key.values().map(key).chain(fields).collect()
    });
    list(header, changes.by.len() + 1, rows, limit, width)
}

fn flips_by_metric(flips: &[Flip]) -> Option<String> {
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
        (Some(before), Some(after)) if after.cmp_value(before).is_gt() => "up",
        (Some(_), Some(_)) => "down",
        (None, _) => "from undefined",
        (_, None) => "to undefined",
    }
}

fn flips(flips: &[Flip], limit: usize, width: Option<usize>) -> Option<String> {
    let explained = flips.iter().any(|flip| flip.timesteps.before.is_some() || flip.timesteps.after.is_some());
    let mut header = ["metric", "experiment", "model", "episode", "before", "after"].map(str::to_owned).to_vec();
    if explained {
        header.extend(["decided before at", "decided after at"].map(str::to_owned));
    }
    let rows = flips.iter().map(|flip| {
        let name = &flip.episode;
        let mut row: Vec<String> =
            [&flip.metric, &name.experiment, &name.model, &name.episode_id].map(|text| visible(text)).to_vec();
        row.extend([flip.value.before, flip.value.after].map(value));
        if explained {
            row.extend([&flip.timesteps.before, &flip.timesteps.after].map(|steps| timesteps(steps.as_ref())));
        }
        row
    });
    list(header, 4, rows, limit, width)
}

/// The first rows of a list, and how many more there are; `None` without any.
fn list(
    header: Vec<String>,
    names: usize,
    rows: impl ExactSizeIterator<Item = Vec<String>>,
    limit: usize,
    width: Option<usize>,
) -> Option<String> {
    let rest = left_out(rows.len(), limit);
    match (rows.len(), limit) {
        (0, _) => return None,
        (_, 0) => return rest.map(|rest| format!("  {rest}")),
        _ => {}
    }
    let table = Table::list(Look::Ruled, names, header.into_iter().map(Column::left));
    let table = table.with(rows.take(limit)).within(width);
    Some(rest.map_or_else(|| table.trim_end_matches('\n').to_owned(), |rest| format!("{table}  {rest}")))
}

fn left_out(all: usize, limit: usize) -> Option<String> {
    let rest = all.saturating_sub(limit);
    (rest > 0).then(|| format!("{rest} more: --limit shows more, --json all"))
}

fn pair(pair: &Pair<String>) -> String {
    if pair.before == pair.after { pair.after.clone() } else { format!("{} -> {}", pair.before, pair.after) }
}

fn key(value: &KeyValue) -> String {
    match value {
        KeyValue::Missing => UNDEFINED.to_owned(),
        value => visible(&value.to_string()),
    }
}

fn value(value: Option<Decimal>) -> String {
    value.map_or_else(|| UNDEFINED.to_owned(), |value| value.to_string())
}

fn n(numbers: &Pair<Option<Numbers>>) -> String {
    let one = |numbers: Option<Numbers>| numbers.map_or_else(|| "no episode".to_owned(), |cell| cell.n.to_string());
    pair(&Pair { before: one(numbers.before), after: one(numbers.after) })
}

/// The mean as counts and as a number: `18/21 = 0.857 -> 19/21 = 0.905`.
fn mean(numbers: &Pair<Option<Numbers>>) -> String {
    let one = |numbers: Option<Numbers>| match numbers {
        Some(cell) if cell.n > 0 => {
            let below = i128::from(cell.n) * 10_i128.pow(cell.sum.places());
            let mean = Decimal::of_ratio(cell.sum.units(), below, PLACES);
            let mean = mean.map_or_else(String::new, |mean| format!(" = {mean}"));
            format!("{}/{}{mean}", cell.sum, cell.n)
        }
        _ => UNDEFINED.to_owned(),
    };
    pair(&Pair { before: one(numbers.before), after: one(numbers.after) })
}

fn mean_change(cell: &CellChange) -> String {
    let change = cell.exact_mean_change().and_then(|(above, below)| Decimal::of_ratio(above, below, PLACES));
    let sign = |above: i128| if above > 0 { "+" } else { "" };
    let above = cell.exact_mean_change().map_or(0, |(above, _)| above);
    change.map_or_else(String::new, |change| format!("{}{change}", sign(above)))
}

fn se(numbers: &Pair<Option<Numbers>>) -> String {
    let one = |numbers: Option<Numbers>| {
        let se = numbers.and_then(|cell| cell.se).and_then(|se| Decimal::of_float(se, PLACES));
        se.map_or_else(|| UNDEFINED.to_owned(), |se| se.to_string())
    };
    pair(&Pair { before: one(numbers.before), after: one(numbers.after) })
}

/// The timesteps that decided a value: `t = 3-7, 9`.
fn timesteps(timesteps: Option<&Vec<i64>>) -> String {
    let Some(timesteps) = timesteps else { return "not known".to_owned() };
    if timesteps.is_empty() {
        return "no step".to_owned();
    }
    let all = ranges(timesteps);
    let runs: Vec<&str> = all.split(", ").collect();
    if runs.len() <= MOST_RUNS {
        return format!("t = {all}");
    }
    format!("t = {}, ... ({} steps)", runs[..MOST_RUNS].join(", "), timesteps.len())
}

#[cfg(test)]
mod tests {
    use super::{left_out, timesteps};

    #[test]
    fn long_lists_count_their_omissions() {
        assert_eq!(left_out(5, 5), None);
        assert_eq!(left_out(7, 5).unwrap(), "2 more: --limit shows more, --json all");
        let odd: Vec<i64> = (0..10).map(|at| 2 * at + 1).collect();
        assert_eq!(timesteps(Some(&odd)), "t = 1, 3, 5, 7, 9, 11, ... (10 steps)");
    }

    #[test]
    fn no_step_is_not_an_unknown_step() {
        assert_eq!([timesteps(None), timesteps(Some(&vec![]))], ["not known", "no step"]);
        assert_eq!(timesteps(Some(&vec![2, 3, 4, 9])), "t = 2-4, 9");
    }
}
