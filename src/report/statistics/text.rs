//! Statistics for people: conclusions first, then the tables they rest on.
//!
//! Rule: text from traces is shown, never obeyed ([`visible`]).

pub mod sequential;

use std::fmt::Write as _;

use comfy_table::{CellAlignment, ContentArrangement, Table, presets};

use super::{CellRow, Intervals, Role, Statistics, Verdict};
use crate::base::escape::visible;
use crate::base::format::{bounds, fixed, p_value};
use crate::metric::catalog::Kind;
use crate::report::tables::fit::{fitted, wrapped};
use crate::stats::interval::Interval;

/// The whole text, its tables about these metrics alone, in lines of at most `width` columns.
///
/// A table that has nothing to show is left out. [`Statistics::headline`] is what a reader wants who did not choose.
pub fn render(statistics: &Statistics, metrics: &[String], width: Option<usize>) -> String {
    let shown = |metric: &String| metrics.contains(metric);
    let percent = percent(statistics.confidence);
    let mut text = format!(
        "{} episodes, definitions {}, {percent} confidence\n",
        statistics.episodes,
        visible(&statistics.definitions)
    );
    list(&mut text, "What can be concluded", &statistics.conclusions, width);
    list(&mut text, "What can not", &statistics.warnings, width);
    for (title, grid) in [
        (&*format!("Rates, {percent} intervals"), rates(statistics, &shown)),
        (&*format!("Quantities, {percent} intervals of the mean"), quantities(statistics, &shown)),
        ("Against chance: exact binomial test, Holm over the models", chance(statistics, &shown)),
        ("Models told apart: exact McNemar test, Holm over all pairs", separated(statistics, &shown)),
        ("Between conditions: first experiment minus the other", conditions(statistics, &shown)),
        ("By seed: clustered standard errors, t(seeds - 1)", clusters(statistics, &shown)),
        ("Durations: unfinished episodes censored at their length", durations(statistics, &shown)),
        ("Lost to infrastructure", losses(statistics, &shown)),
    ] {
        section(&mut text, title, &grid, width);
    }
    text.push('\n');
    for line in METHODS {
        push_wrapped(&mut text, line, width, 0);
    }
    text
}

/// The methods, in the lines that they have where there is room.
const METHODS: [&str; 2] = [
    "Methods: Wilson, Clopper-Pearson and Jeffreys intervals of rates; Student's t and a seeded BCa bootstrap of means;",
    "differences by Newcombe's method 10 (paired and independent) or Welch's t, not adjusted for their number.",
];

fn push_wrapped(text: &mut String, words: &str, width: Option<usize>, indent: usize) {
    for line in wrapped(words, width.unwrap_or(usize::MAX), indent) {
        let _ = writeln!(text, "{line}");
    }
}

type Shown<'a> = &'a dyn Fn(&String) -> bool;

fn list(text: &mut String, title: &str, sentences: &[String], width: Option<usize>) {
    if sentences.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n{title}");
    for sentence in sentences {
        push_wrapped(text, &format!("  - {}", visible(sentence)), width, 4);
    }
}

fn section(text: &mut String, title: &str, rows: &Grid, width: Option<usize>) {
    if !rows.lines.is_empty() {
        let _ = write!(text, "\n{title}\n{}", rows.render(width));
    }
}

/// Lines under a header: columns of text first, then columns of numbers, which stand to the right.
struct Grid {
    header: Vec<String>,
    texts: usize,
    lines: Vec<Vec<String>>,
}

impl Grid {
    /// The names of the text columns, then those of the numbers.
    fn new<T: AsRef<str>>(texts: &[T], numbers: &[&str]) -> Self {
        let header = texts.iter().map(AsRef::as_ref).chain(numbers.iter().copied());
        Self { header: header.map(visible).collect(), texts: texts.len(), lines: Vec::new() }
    }

    fn with(mut self, lines: impl Iterator<Item = Vec<String>>) -> Self {
        self.lines.extend(lines);
        self
    }

    fn render(&self, width: Option<usize>) -> String {
        let mut table = Table::new();
        table.load_style(presets::NOTHING).set_content_arrangement(ContentArrangement::Disabled);
        table.set_header(&self.header);
        table.add_rows(self.lines.iter().map(|line| line.iter().map(|cell| visible(cell))));
        for (at, column) in table.column_iter_mut().enumerate() {
            column.set_cell_alignment(if at < self.texts { CellAlignment::Left } else { CellAlignment::Right });
        }
        fitted(&table, self.texts, width) + "\n"
    }
}

fn rates(statistics: &Statistics, shown: Shown) -> Grid {
    let lines = statistics.cells.iter().filter(|cell| shown(&cell.metric)).filter_map(|cell| {
        let Intervals::Rate { wilson, clopper_pearson, jeffreys } = cell.intervals else { return None };
        let count = format!("{}/{}{}", cell.sum, cell.n, mark(cell));
        let mut line = group(cell);
        line.extend([count, fixed(cell.mean, 3), of(wilson, 3), of(clopper_pearson, 3), of(jeffreys, 3)]);
        Some(line)
    });
    let numbers = ["count", "rate", "Wilson", "Clopper-Pearson", "Jeffreys"];
    Grid::new(&keys(statistics), &numbers).with(lines)
}

fn quantities(statistics: &Statistics, shown: Shown) -> Grid {
    let lines = statistics.cells.iter().filter(|cell| shown(&cell.metric)).filter_map(|cell| {
        let Intervals::Quantity { student_t, bootstrap } = cell.intervals else { return None };
        let mut line = group(cell);
        let n = format!("{}{}", cell.n, mark(cell));
        line.extend([n, fixed(cell.mean, 2), error(cell.se, 2), of(student_t, 2), of(bootstrap, 2)]);
        Some(line)
    });
    Grid::new(&keys(statistics), &["n", "mean", "SE", "Student's t", "bootstrap"]).with(lines)
}

fn keys(statistics: &Statistics) -> Vec<String> {
    statistics.by.iter().map(String::as_str).chain(["metric"]).map(str::to_owned).collect()
}

fn group(cell: &CellRow) -> Vec<String> {
    cell.key.values().map(ToString::to_string).chain([cell.metric.clone()]).collect()
}

/// The dagger of a conditional metric with few defined episodes.
fn mark(cell: &CellRow) -> &'static str {
    if cell.few { "†" } else { "" }
}

fn chance(statistics: &Statistics, shown: Shown) -> Grid {
    let line = |row: &super::ChanceRow| {
        let role = match row.role {
            Role::Chance => "chance",
            Role::Reference => "reference",
        };
        let verdict = match row.verdict {
            Verdict::Above => "above",
            Verdict::Below => "below",
            Verdict::NotSeparated => "not told apart",
        };
        let (level, count) = (format!("{role} {}", row.level), format!("{}/{}", row.successes, row.n));
        let (p, adjusted) = (p_value(Some(row.p)), p_value(Some(row.p_adjusted)));
        vec![
            row.experiment.clone(),
            row.model.clone(),
            row.metric.clone(),
            level,
            count,
            p,
            adjusted,
            verdict.to_owned(),
        ]
    };
    let rows = statistics.chance.iter().filter(|row| shown(&row.metric)).map(line);
    Grid::new(&["experiment", "model", "metric", "level"], &["count", "p", "p (Holm)", "verdict"]).with(rows)
}

fn separated(statistics: &Statistics, shown: Shown) -> Grid {
    let families = statistics.models.iter().filter(|family| shown(&family.metric));
    let lines = families.flat_map(|family| {
        family.tests.iter().filter(|test| test.separated).map(|test| {
            let only = format!("{}:{}", test.pairs.first_only, test.pairs.second_only);
            let (experiment, metric) = (family.experiment.clone(), family.metric.clone());
            let (difference, interval) = (fixed(test.difference, 3), of(test.interval, 3));
            let adjusted = p_value(test.p_adjusted);
            let (first, second) = (test.first.clone(), test.second.clone());
            vec![experiment, metric, first, second, only, difference, interval, p_value(test.p), adjusted]
        })
    });
    let texts = ["experiment", "metric", "better", "than"];
    Grid::new(&texts, &["only one", "difference", "interval", "p", "p (Holm)"]).with(lines)
}

fn conditions(statistics: &Statistics, shown: Shown) -> Grid {
    let lines = statistics.conditions.iter().filter(|contrast| shown(&contrast.metric)).map(|contrast| {
        let places = if contrast.method == super::Method::Newcombe { 3 } else { 2 };
        let pair = format!("{} - {}", contrast.baseline, contrast.against);
        let n = format!("{}, {}", contrast.n_baseline, contrast.n_against);
        let (difference, interval) = (fixed(contrast.difference, places), of(contrast.interval, places));
        vec![contrast.model.clone(), contrast.metric.clone(), pair, n, difference, interval]
    });
    Grid::new(&["model", "metric", "conditions"], &["n", "difference", "interval"]).with(lines)
}

fn clusters(statistics: &Statistics, shown: Shown) -> Grid {
    let kind = |metric: &str| statistics.cells.iter().find(|cell| cell.metric == metric).map(|cell| cell.kind);
    let lines = statistics.clusters.iter().filter(|row| shown(&row.metric)).map(|row| {
        let places = if kind(&row.metric) == Some(Kind::Rate) { 3 } else { 2 };
        let by_seed = row.by_seed;
        let numbers = [
            row.seeds.to_string(),
            row.n.to_string(),
            fixed(row.mean, places),
            error(row.se, places),
            error(by_seed.map(|by_seed| by_seed.se), places),
            of(by_seed.map(|by_seed| by_seed.interval), places),
            fixed(by_seed.and_then(|by_seed| by_seed.icc), 2),
            fixed(by_seed.and_then(|by_seed| by_seed.design_effect), 2),
        ];
        [row.experiment.clone(), row.model.clone(), row.metric.clone()].into_iter().chain(numbers).collect()
    });
    let numbers = ["seeds", "n", "mean", "SE", "SE by seed", "interval by seed", "ICC", "design effect"];
    Grid::new(&["experiment", "model", "metric"], &numbers).with(lines)
}

fn durations(statistics: &Statistics, shown: Shown) -> Grid {
    let lines = statistics.durations.iter().filter(|row| shown(&row.metric)).map(|row| {
        let restricted = row.restricted;
        let numbers = [
            format!("{}/{}", row.finished, row.n),
            fixed(row.mean, 2),
            row.median.map_or_else(|| "not reached".to_owned(), |median| median.to_string()),
            fixed(restricted.map(|restricted| restricted.mean), 2),
            of(restricted.map(|restricted| restricted.interval), 2),
            restricted.map_or_else(|| fixed(None, 0), |restricted| restricted.horizon.to_string()),
        ];
        [row.experiment.clone(), row.model.clone(), row.metric.clone()].into_iter().chain(numbers).collect()
    });
    let numbers = ["finished", "mean", "median", "restricted mean", "interval", "up to"];
    Grid::new(&["experiment", "model", "metric"], &numbers).with(lines)
}

fn losses(statistics: &Statistics, shown: Shown) -> Grid {
    let lines = statistics.losses.rows.iter().filter(|row| shown(&row.metric)).map(|row| {
        let lossy = row.lossy;
        let (count, lost) = (format!("{}/{}", lossy.successes, lossy.n), lossy.lost.to_string());
        let bounds = [of(Some(lossy.bounds), 3), of(Some(lossy.interval), 3)];
        let names = [row.experiment.clone(), row.model.clone(), row.metric.clone()];
        names.into_iter().chain([count, lost]).chain(bounds).collect()
    });
    let numbers = ["without them", "lost", "bounds", "interval around the bounds"];
    Grid::new(&["experiment", "model", "metric"], &numbers).with(lines)
}

/// An interval; one that is a point says that the values gave no spread to judge by.
fn of(interval: Option<Interval>, places: usize) -> String {
    if interval.is_some_and(|interval| interval.low >= interval.high) {
        return "no spread".to_owned();
    }
    bounds(interval.map(|interval| (interval.low, interval.high)), places)
}

/// A standard error; zero is no certainty.
fn error(se: Option<f64>, places: usize) -> String {
    fixed(se.filter(|&se| se > 0.0), places)
}

fn percent(confidence: f64) -> String {
    let text = fixed(Some(confidence * 100.0), 3);
    format!("{} %", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::percent;

    #[test]
    fn a_confidence_is_a_percentage() {
        assert_eq!([percent(0.95), percent(0.995), percent(0.9)], ["95 %", "99.5 %", "90 %"]);
    }
}
