//! The tables of `stats`, one function each: one line per row of the statistics whose metric is shown.

use super::super::ranks::ALL;
use super::super::study::named;
use super::super::{
    CellRow, Comparison, Intervals, LossCases, Method, OverallMethod, Role, Sign, Statistics, Units, Verdict,
};
use crate::tables::Table;
use exact::format::{UNDEFINED, bounds, fixed, p_value};
use metric::catalog::Kind;
use statistics::coverage::Withheld;
use statistics::interval::Interval;

pub(super) type Shown<'a> = &'a dyn Fn(&str) -> bool;

/// The mark of a conditional metric with few defined episodes.
pub(super) const FEW_MARK: char = '†';

/// The columns of lost episodes and replies without a decision; empty if no cell has any.
fn left_out(cells: &[CellRow]) -> impl Fn(&CellRow) -> Vec<String> + use<> {
    let names: Vec<&str> = names_of_left_out(cells).collect();
    move |cell| {
        let counts = [("lost", cell.lost), ("no decision", cell.unusable_replies)];
        let counts = counts.into_iter().filter(|(name, _)| names.contains(name));
        counts.map(|(_, count)| count.unwrap_or(0).to_string()).collect()
    }
}

fn names_of_left_out(cells: &[CellRow]) -> impl Iterator<Item = &'static str> {
    let lost = cells.iter().any(|cell| cell.lost.is_some()).then_some("lost");
    let replies = cells.iter().any(|cell| cell.unusable_replies.is_some()).then_some("no decision");
    lost.into_iter().chain(replies)
}

/// Rates with Wilson's interval; also the other two if `is_full`.
pub(super) fn rates(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let left_out = left_out(&statistics.cells);
    let lines = statistics.cells.iter().filter(|cell| shown(&cell.metric)).filter_map(|cell| {
        let Intervals::Rate { wilson, clopper_pearson, jeffreys } = cell.intervals else { return None };
        let mut line = group(cell);
        line.extend([format!("{}/{}{}", cell.sum, cell.n, mark(cell)), fixed(cell.mean, 3), plain(wilson, 3)]);
        if is_full {
            line.extend([plain(clopper_pearson, 3), plain(jeffreys, 3)]);
        }
        line.extend(left_out(cell));
        Some(line)
    });
    let numbers = ["count", "rate", "Wilson", "Clopper-Pearson", "Jeffreys"];
    let numbers = numbers[..if is_full { 5 } else { 3 }].iter().copied();
    let numbers: Vec<&str> = numbers.chain(names_of_left_out(&statistics.cells)).collect();
    Table::plain(&keys(statistics), &numbers).with(lines)
}

pub(super) fn quantities(statistics: &Statistics, shown: Shown) -> Table {
    let left_out = left_out(&statistics.cells);
    let lines = statistics.cells.iter().filter(|cell| shown(&cell.metric)).filter_map(|cell| {
        let Intervals::Quantity { student_t, student_t_withheld, bootstrap, bootstrap_withheld } = cell.intervals
        else {
            return None;
        };
        let mut line = group(cell);
        line.extend([format!("{}{}", cell.n, mark(cell)), fixed(cell.mean, 2), error(cell.se, 2)]);
        line.extend([held(student_t, student_t_withheld, 2), held(bootstrap, bootstrap_withheld, 2)]);
        line.extend(left_out(cell));
        Some(line)
    });
    let numbers = ["n", "mean", "SE", "Student's t", "bootstrap"].into_iter();
    let numbers: Vec<&str> = numbers.chain(names_of_left_out(&statistics.cells)).collect();
    Table::plain(&keys(statistics), &numbers).with(lines)
}

fn keys(statistics: &Statistics) -> Vec<String> {
    statistics.by.iter().map(String::as_str).chain(["metric"]).map(str::to_owned).collect()
}

fn group(cell: &CellRow) -> Vec<String> {
    cell.key.values().map(ToString::to_string).chain([cell.metric.clone()]).collect()
}

fn mark(cell: &CellRow) -> String {
    if cell.few { FEW_MARK.to_string() } else { String::new() }
}

/// Rates against their levels; a rate is shown with the same rate among finished episodes.
pub(super) fn chance(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let is_shown = |metric: &str| shown(metric) || statistics.relations.whole(metric).is_some_and(shown);
    let has_losses = statistics.chance.iter().any(|row| row.losses.is_some());
    let columns = Columns { is_full, has_losses, has_repeats: false };
    let line = |row: &super::super::ChanceRow| {
        let role = match row.role {
            Role::Chance => "chance",
            Role::Reference => "reference",
        };
        let verdict = match row.verdict {
            Verdict::Above => "above",
            Verdict::Below => "below",
            Verdict::NotSeparated if row.unsaid(statistics.confidence).is_some() => CANNOT_SAY,
            Verdict::NotSeparated => "not told apart",
        };
        let mut line = vec![row.experiment.clone(), row.name(), row.metric.clone(), format!("{role} {}", row.level)];
        line.push(format!("{}/{}{}", row.successes, row.n, of_units(row.units.as_ref())));
        line.extend(columns.p_values([Some(row.p), Some(row.mid_p), Some(row.p_adjusted)]));
        line.extend(columns.lost(row.losses.as_ref()));
        line.push(verdict.to_owned());
        line
    };
    let rows = statistics.chance.iter().filter(|row| is_shown(&row.metric)).map(line);
    let numbers = [&["count"], columns.names().as_slice(), &["verdict"]].concat();
    Table::plain(&["experiment", "model", "metric", "level"], &numbers).with(rows)
}

/// The verdict if no outcome of the few units, or of the lost episodes, could have given one.
const CANNOT_SAY: &str = "cannot say";

/// The heading of the p values under both assumptions about lost episodes.
const WITH_LOST: &str = "p with lost episodes";

/// The p values of a table.
#[derive(Clone, Copy)]
struct Columns {
    is_full: bool,
    has_losses: bool,
    has_repeats: bool,
}

impl Columns {
    fn of<'c>(mut comparisons: impl Iterator<Item = &'c Comparison> + Clone, is_full: bool) -> Self {
        let has_losses = comparisons.clone().any(|found| found.losses.is_some());
        let has_repeats = comparisons.any(|found| found.repeat_se.is_some());
        Self { is_full, has_losses, has_repeats }
    }

    fn names(self) -> Vec<&'static str> {
        let all = if self.is_full { ["p", "mid-p", "p (Holm)"].as_slice() } else { &["p", "p (Holm)"] };
        let lost = self.has_losses.then_some(WITH_LOST);
        let noise = self.has_repeats.then_some("SE of repeats");
        noise.into_iter().chain(all.iter().copied()).chain(lost).collect()
    }

    fn p_values(self, [p, mid_p, adjusted]: [Option<f64>; 3]) -> Vec<String> {
        let shown = if self.is_full { vec![p, mid_p, adjusted] } else { vec![p, adjusted] };
        shown.into_iter().map(p_value).collect()
    }

    fn lost(self, cases: Option<&LossCases>) -> Option<String> {
        let both = |cases: &LossCases| format!("{}, {}", p_value(cases.lowest.p), p_value(cases.highest.p));
        self.has_losses.then(|| cases.map_or_else(|| UNDEFINED.to_owned(), both))
    }
}

/// The number of units beside the episodes.
fn of_units(units: Option<&Units>) -> String {
    units.map_or_else(String::new, |units| format!(" in {} {}", units.n, units.name))
}

pub(super) fn separated(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let pairs = statistics.models.iter().flat_map(|family| &family.tests);
    let columns = Columns::of(pairs.map(|test| &test.comparison), is_full);
    let families = statistics.models.iter().filter(|family| shown(&family.metric));
    let lines = families.flat_map(|family| {
        family.tests.iter().filter(|test| test.comparison.separated).map(|test| {
            let names = [&family.experiment, &family.metric, &test.first, &test.second].map(Clone::clone);
            names.into_iter().chain(compared(&test.comparison, columns))
        })
    });
    let texts = ["experiment", "metric", "better", "than", "test"];
    let numbers = [&["counts", "difference", "interval"], columns.names().as_slice()].concat();
    Table::plain(&texts, &numbers).with(lines)
}

pub(super) fn conditions(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let columns = Columns::of(statistics.conditions.iter().map(|contrast| &contrast.comparison), is_full);
    let lines = statistics.conditions.iter().filter(|contrast| shown(&contrast.metric)).map(|contrast| {
        let pair = format!("{} - {}", contrast.baseline, contrast.against);
        let names = [named(&contrast.model, contrast.condition.as_deref()), contrast.metric.clone(), pair];
        let verdict = match contrast.comparison.sign() {
            Some(Sign::Higher) => "higher",
            Some(Sign::Lower) => "lower",
            None if contrast.comparison.unsaid(statistics.confidence).is_some() => CANNOT_SAY,
            None if contrast.comparison.p.is_some() => "not told apart",
            None => UNDEFINED,
        };
        names.into_iter().chain(compared(&contrast.comparison, columns)).chain([verdict.to_owned()])
    });
    let numbers = [&["counts", "difference", "interval"], columns.names().as_slice(), &["verdict"]].concat();
    Table::plain(&["model", "metric", "conditions", "test"], &numbers).with(lines)
}

pub(super) fn trends(statistics: &Statistics, shown: Shown) -> Table {
    let lines = statistics.trends.iter().filter(|row| shown(&row.metric)).map(|row| {
        let rates: Vec<String> =
            row.doses.iter().map(|dose| format!("{}: {}/{}", dose.dose, dose.successes, dose.n)).collect();
        let verdict = match (row.trend, row.too_few(), row.verdict) {
            (None, ..) => "not tested".to_owned(),
            (_, Some(units), _) => format!("cannot say: {units} {}", row.units),
            (.., Verdict::Above) => "rises".to_owned(),
            (.., Verdict::Below) => "falls".to_owned(),
            (.., Verdict::NotSeparated) => "no trend shown".to_owned(),
        };
        let z = row.trend.map_or_else(|| UNDEFINED.to_owned(), |trend| fixed(Some(trend.z), 2));
        let strata = row.trend.map_or_else(|| UNDEFINED.to_owned(), |trend| format!("{} {}", trend.strata, row.units));
        let p = p_value(row.p_adjusted);
        [
            row.factor.clone(),
            row.metric.clone(),
            named(&row.model, row.condition.as_deref()),
            rates.join(", "),
            strata,
            z,
            p,
            verdict,
        ]
    });
    Table::plain(&["factor", "metric", "model", "rates by dose"], &["compared within", "z", "p adjusted", "verdict"])
        .with(lines)
}

fn compared(found: &Comparison, columns: Columns) -> Vec<String> {
    let (test, places) = method(found.method);
    let [m, n] = found.n;
    let counts = match (found.pairs, found.successes) {
        (Some(pairs), _) => format!("{}:{} of {m} pairs", pairs.first_only, pairs.second_only),
        (None, Some([k, l])) => format!("{k}/{m}, {l}/{n}"),
        _ if matches!(found.method, Method::RestrictedMeanPaired | Method::StudentPaired) => format!("{m} pairs"),
        _ => format!("{m}, {n}"),
    };
    let counts = counts + &of_units(found.units.as_ref());
    let mut line = vec![test.to_owned(), counts, fixed(found.difference, places)];
    line.push(held(found.interval, found.withheld, places));
    line.extend(columns.has_repeats.then(|| fixed(found.repeat_se, places)));
    line.extend(columns.p_values([found.p, found.mid_p, found.p_adjusted]));
    line.extend(columns.lost(found.losses.as_ref()));
    line
}

pub(super) const fn method(method: Method) -> (&'static str, usize) {
    match method {
        Method::Mcnemar => ("McNemar", 3),
        Method::Fisher => ("Fisher", 3),
        Method::Units => ("by scene or cluster", 3),
        Method::RestrictedMeanPaired => ("restricted means, pairs", 2),
        Method::RestrictedMean => ("restricted means", 2),
        Method::StudentPaired => ("Student's t, pairs", 2),
        Method::Welch => ("Welch's t", 2),
    }
}

/// Pairs of models over all experiments: all pairs if `is_full`, else only separated ones.
pub(super) fn overall(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let rows = statistics.overall.iter().filter(|row| shown(&row.metric) && (is_full || row.separated));
    let columns = Columns { is_full, has_losses: rows.clone().any(|row| row.losses.is_some()), has_repeats: false };
    let lines = rows.map(|row| {
        let test = match row.method {
            OverallMethod::MantelHaenszel => "exact conditional",
            OverallMethod::PooledMcnemar => "McNemar, pooled",
            OverallMethod::Units => "by scene or cluster",
        };
        let is_unsettled = row.losses.is_some_and(|losses| !losses.agree);
        let verdict = match (row.separated, is_unsettled) {
            (true, _) => "better",
            (false, true) => CANNOT_SAY,
            (false, false) => "not told apart",
        };
        let mut line: Vec<String> = [&*row.metric, &row.first, &row.second, test].map(str::to_owned).to_vec();
        line.extend([row.experiments.len().to_string(), fixed(row.difference, 3), plain(row.interval, 3)]);
        let p_values = if is_full { vec![row.p, row.mid_p, row.p_adjusted] } else { vec![row.p, row.p_adjusted] };
        line.extend(p_values.into_iter().map(p_value));
        line.extend(columns.lost(row.losses.as_ref()));
        line.push(verdict.to_owned());
        line
    });
    let p_values = if is_full { ["p", "mid-p", "p (Holm)"].as_slice() } else { &["p", "p (Holm)"] };
    let lost = columns.has_losses.then_some(WITH_LOST);
    let numbers = ["experiments", "difference", "interval"].iter().chain(p_values).copied().chain(lost);
    let numbers: Vec<&str> = numbers.chain(["verdict"]).collect();
    Table::plain(&["metric", "first", "second", "test"], &numbers).with(lines)
}

pub(super) fn ranks(statistics: &Statistics, shown: Shown) -> Table {
    let lines = statistics.ranks.iter().filter(|row| shown(&row.metric)).map(|row| {
        let experiment = row.experiment.as_deref().unwrap_or(ALL);
        [experiment, &row.metric, &row.model].map(str::to_owned).into_iter().chain([row.interval()])
    });
    Table::plain(&["experiment", "metric", "model"], &["ranks"]).with(lines)
}

pub(super) fn improvements(statistics: &Statistics, shown: Shown) -> Table {
    let lines = statistics.improvements.iter().filter(|row| shown(&row.metric)).map(|row| {
        let names = [&row.metric, &row.first, &row.second].map(Clone::clone);
        let found = row.improvement;
        let numbers = [row.experiments.len().to_string(), fixed(Some(found.probability), 3), plain(found.interval, 3)];
        names.into_iter().chain(numbers)
    });
    Table::plain(&["metric", "earlier", "than"], &["experiments", "probability", "interval"]).with(lines)
}

pub(super) fn clusters(statistics: &Statistics, shown: Shown) -> Table {
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
            held(by_seed.and_then(|by_seed| by_seed.interval), row.withheld, places),
            fixed(by_seed.and_then(|by_seed| by_seed.icc), 2),
            fixed(by_seed.and_then(|by_seed| by_seed.design_effect), 2),
        ];
        let model = named(&row.model, row.condition.as_deref());
        [row.experiment.clone(), model, row.metric.clone()].into_iter().chain(numbers)
    });
    let numbers = ["seeds", "n", "mean", "SE", "SE by seed", "interval by seed", "ICC", "design effect"];
    Table::plain(&["experiment", "model", "metric"], &numbers).with(lines)
}

pub(super) fn durations(statistics: &Statistics, shown: Shown) -> Table {
    let lines = statistics.durations.iter().filter(|row| shown(&row.metric)).map(|row| {
        let restricted = row.restricted;
        let median_interval = row.median_interval.map(|found| match found.high {
            Some(high) => format!("[{}, {high}]", found.low),
            None => format!("[{}, open)", found.low),
        });
        let numbers = [
            format!("{}/{}", row.finished, row.n),
            reached(row.median),
            median_interval.unwrap_or_else(|| UNDEFINED.to_owned()),
            fixed(restricted.map(|restricted| restricted.mean), 2),
            held(restricted.and_then(|restricted| restricted.interval), row.withheld, 2),
            restricted.map_or_else(|| UNDEFINED.to_owned(), |restricted| restricted.horizon.to_string()),
        ];
        let model = named(&row.model, row.condition.as_deref());
        [row.experiment.clone(), model, row.metric.clone()].into_iter().chain(numbers)
    });
    let numbers = ["finished", "median", "interval", "restricted mean", "interval", "up to"];
    Table::plain(&["experiment", "model", "metric"], &numbers).with(lines)
}

pub(super) fn correct(statistics: &Statistics, shown: Shown) -> Table {
    let rows = statistics.durations.iter().filter(|row| shown(&row.metric));
    let lines = rows.filter_map(|row| {
        let correct = row.correct.as_ref()?;
        let numbers = [
            fixed(Some(correct.correct), 3),
            fixed(Some(correct.wrong), 3),
            reached(correct.median),
            fixed(Some(correct.restricted.mean), 2),
            held(correct.restricted.interval, correct.withheld, 2),
            correct.restricted.horizon.to_string(),
        ];
        let model = named(&row.model, row.condition.as_deref());
        Some([row.experiment.clone(), model, row.metric.clone()].into_iter().chain(numbers))
    });
    let numbers = ["correct", "wrong", "half correct", "restricted mean", "interval", "up to"];
    Table::plain(&["experiment", "model", "metric"], &numbers).with(lines)
}

pub(super) fn retests(statistics: &Statistics, shown: Shown) -> Table {
    let lines = statistics.retests.iter().filter(|row| shown(&row.metric)).map(|row| {
        let numbers = [
            row.scenes.to_string(),
            row.episodes.to_string(),
            format!("{}/{}", row.unstable, row.scenes),
            fixed(Some(row.flipped), 3),
            fixed(row.between_scenes, 3),
            fixed(row.within_scenes, 3),
        ];
        let names = [row.experiment.clone(), named(&row.model, row.condition.as_deref()), row.metric.clone()];
        names.into_iter().chain(numbers)
    });
    let flipped = "flipped from one time to the next";
    let numbers = ["scenes", "episodes", "not always the same", flipped, "variance by scene", "by repeat"];
    Table::plain(&["experiment", "model", "metric"], &numbers).with(lines)
}

pub(super) fn losses(statistics: &Statistics, shown: Shown) -> Table {
    let lines = statistics.losses.rows.iter().filter(|row| shown(&row.metric)).map(|row| {
        let lossy = row.lossy;
        let (count, lost) = (format!("{}/{}", lossy.successes, lossy.n), lossy.lost.to_string());
        let bounds = [lossy.bounds, lossy.interval].map(|interval| plain(Some(interval), 3));
        let names = [row.experiment.clone(), named(&row.model, row.condition.as_deref()), row.metric.clone()];
        names.into_iter().chain([count, lost]).chain(bounds)
    });
    let numbers = ["without them", "lost", "bounds", "interval around the bounds"];
    Table::plain(&["experiment", "model", "metric"], &numbers).with(lines)
}

fn reached(median: Option<i64>) -> String {
    median.map_or_else(|| "not reached".to_owned(), |median| median.to_string())
}

fn plain(interval: Option<Interval>, places: usize) -> String {
    bounds(interval.map(|interval| (interval.low, interval.high)), places)
}

pub(super) fn held(interval: Option<Interval>, withheld: Option<Withheld>, places: usize) -> String {
    match (interval, withheld) {
        (None, Some(Withheld::TooFew { fewest })) => format!("{UNDEFINED} (n < {fewest})"),
        (None, Some(Withheld::NoSpread)) => format!("{UNDEFINED} (no spread)"),
        (None, Some(Withheld::Incomparable)) => format!("{UNDEFINED} (not comparable)"),
        _ => plain(interval, places),
    }
}

fn error(se: Option<f64>, places: usize) -> String {
    fixed(se.filter(|&se| se > 0.0), places)
}
