//! The tables of `stats`, one function each: one line per row of the statistics whose metric is shown.

use indexmap::{IndexMap, IndexSet};

use super::percent;
use super::text_table::TextTable;
use crate::statistics::comparisons::matching::singular;
use crate::statistics::rates::ranks::ALL;
use crate::statistics::{
    CellRow, ChanceRow, Comparison, DesignAudit, Dose, Family, Intervals, LossCases, Method, OverallMethod, RankRow,
    Sign, Statistics, Units, Verdict, span,
};
use crate::study::named;
use mirrorstats_exact::chance::with_strategy;
use mirrorstats_exact::format::{UNDEFINED, bounds, counted, fixed, p_value};
use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_statistics::intervals::coverage::Withheld;
use mirrorstats_statistics::intervals::interval::Interval;
use mirrorstats_tables::Table;

pub(super) type Shown<'a> = &'a dyn Fn(&str) -> bool;

/// The mark of a conditional metric with few defined episodes.
pub(super) const FEW_MARK: char = '†';

pub(super) const RATE_PLACES: usize = 3;

/// The verdict if no outcome of the few units, or of the lost episodes, could have given one.
const CANNOT_SAY: &str = "cannot say";

/// Rates with Wilson's interval; also the other two if `is_full`.
pub(super) fn rates(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let title = if is_full { "intervals" } else { "score intervals (Wilson)" };
    let of_rate = |intervals| match intervals {
        Intervals::Rate { wilson, clopper_pearson, jeffreys } => Some([wilson, clopper_pearson, jeffreys]),
        Intervals::Quantity { .. } => None,
    };
    let has_units = statistics.cells.iter().any(|cell| cell.unit_mean.is_some());
    TextTable::of_cells(statistics, shown, of_rate)
        .number("count", |(cell, _)| format!("{}/{}{}{}", cell.sum, cell.n, mark(cell), of_units(cell.units.as_ref())))
        .number("rate", |(cell, _)| fixed(cell.mean, RATE_PLACES))
        .number_if(has_units, "by unit", |(cell, _)| fixed(cell.unit_mean, RATE_PLACES))
        .number("Wilson", |(_, found)| plain(found[0], 3))
        .number_if(is_full, "Clopper-Pearson", |(_, found)| plain(found[1], 3))
        .number_if(is_full, "Jeffreys", |(_, found)| plain(found[2], 3))
        .left_out(statistics)
        .titled(format!("Rates, {} {title}", percent(statistics.confidence)))
}

pub(super) fn quantities(statistics: &Statistics, shown: Shown) -> Table {
    let percent = percent(statistics.confidence);
    let title = format!("Quantities, {percent} intervals of the plain mean: Student's t, seeded BCa bootstrap");
    let of_quantity = |intervals| match intervals {
        Intervals::Quantity { student_t, student_t_withheld, bootstrap, bootstrap_withheld } => {
            Some([(student_t, student_t_withheld), (bootstrap, bootstrap_withheld)])
        }
        Intervals::Rate { .. } => None,
    };
    TextTable::of_cells(statistics, shown, of_quantity)
        .number("n", |(cell, _)| format!("{}{}", cell.n, mark(cell)))
        .number("mean", |(cell, _)| fixed(cell.mean, 2))
        .number("SE", |(cell, _)| error(cell.se, 2))
        .number("Student's t", |(_, [(interval, withheld), _])| held(*interval, *withheld, 2))
        .number("bootstrap", |(_, [_, (interval, withheld)])| held(*interval, *withheld, 2))
        .left_out(statistics)
        .titled(title)
}

impl<'s, I> TextTable<(&'s CellRow, I)> {
    /// The cells with such intervals, and the columns that they are grouped by.
    fn of_cells(statistics: &'s Statistics, shown: Shown, intervals: impl Fn(Intervals) -> Option<I>) -> Self {
        let cells = statistics.cells.iter().filter(|cell| shown(&cell.metric));
        let table = Self::of(cells.filter_map(|cell| Some((cell, intervals(cell.intervals)?))));
        let by = statistics.by.iter().enumerate();
        by.fold(table, |table, (at, name)| table.text(name, |(cell, _)| cell.key[at].clone()))
            .text("metric", |(cell, _)| cell.metric.clone())
    }

    /// The table with the columns of lost episodes and of replies without a decision, if any cell has some.
    fn left_out(self, statistics: &Statistics) -> Table {
        let has_lost = statistics.cells.iter().any(|cell| cell.lost.is_some());
        let has_unusable = statistics.cells.iter().any(|cell| cell.unusable_replies.is_some());
        self.number_if(has_lost, "lost", |(cell, _)| cell.lost.unwrap_or(0))
            .number_if(has_unusable, "no decision", |(cell, _)| cell.unusable_replies.unwrap_or(0))
            .table()
    }
}

fn mark(cell: &CellRow) -> String {
    if cell.few { FEW_MARK.to_string() } else { String::new() }
}

/// Rates against their levels; a rate is shown with the same rate among finished episodes. Unless `is_full`, without
/// rows that repeat others: a lower level of the same role, the same count among finished episodes, and families
/// without any verdict, which the answers name.
pub(super) fn chance(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let mid_p = if is_full { "; mid-p need not keep the level" } else { "" };
    let is_shown = |metric: &str| shown(metric) || statistics.relations.whole(metric).is_some_and(shown);
    let has_losses = statistics.chance.iter().any(|row| row.losses.is_some());
    let is_new = |row: &ChanceRow| {
        let whole = statistics.relations.whole(&row.metric);
        let is_other = |other: &ChanceRow| {
            let is_alike = (&other.key, other.role) == (&row.key, row.role);
            let is_higher = other.metric == row.metric && other.level.value() > row.level.value();
            let is_same = Some(&*other.metric) == whole
                && (other.successes, other.n, other.verdict) == (row.successes, row.n, row.verdict);
            is_alike && (is_higher || is_same)
        };
        let is_of_family = |other: &&ChanceRow| {
            (&other.key.experiment, &other.metric, other.level) == (&row.key.experiment, &row.metric, row.level)
        };
        let is_said = |row: &ChanceRow| row.unsaid(statistics.confidence).is_none();
        !statistics.chance.iter().any(is_other) && statistics.chance.iter().filter(is_of_family).any(is_said)
    };
    TextTable::of(statistics.chance.iter().filter(|row| is_shown(&row.metric) && (is_full || is_new(row))))
        .cell(|row| (&row.key, &row.metric))
        .text("level", |row| format!("{} {}", row.role.name(), with_strategy(row.level, row.strategy.as_deref())))
        .number("count", |row| {
            let count = beside(&format!("{}/{}", row.successes, row.n), row.unit_mean, RATE_PLACES);
            count + &of_units(row.units.as_ref())
        })
        .p_values(is_full, |row| [Some(row.p), Some(row.mid_p), Some(row.p_adjusted)])
        .lost_if(has_losses, |row| row.losses.as_ref())
        .number("verdict", |row| match row.verdict {
            Verdict::NotSeparated if row.unsaid(statistics.confidence).is_some() => CANNOT_SAY,
            verdict => verdict.name(),
        })
        .table()
        .titled(format!(
            "Against chance: exact binomial test, two-sided by minimum likelihood; Holm over the models{mid_p}"
        ))
}

/// A count of episodes, with the mean over units where the test uses that.
pub(crate) fn beside(count: &str, unit_mean: Option<f64>, places: usize) -> String {
    let mean = unit_mean.map(|mean| format!(" ({} by unit)", fixed(Some(mean), places)));
    count.to_owned() + &mean.unwrap_or_default()
}

fn of_units(units: Option<&Units>) -> String {
    units.map_or_else(String::new, |units| format!(" in {}", units.counted()))
}

impl<R> TextTable<R> {
    /// The column of the p values under both assumptions about lost episodes.
    fn lost_if(self, has_losses: bool, of: impl Fn(&R) -> Option<&LossCases>) -> Self {
        let both = |cases: &LossCases| format!("{}, {}", p_value(cases.lowest.p), p_value(cases.highest.p));
        self.number_if(has_losses, "p with lost episodes", |row| of(row).map_or_else(|| UNDEFINED.to_owned(), both))
    }

    /// The columns of a comparison. A column is left out if none of `all` comparisons, shown or not, has it.
    fn comparison<'c>(
        self,
        mut all: impl Iterator<Item = &'c Comparison> + Clone,
        is_full: bool,
        of: impl Fn(&R) -> &Comparison,
    ) -> Self {
        let has_losses = all.clone().any(|found| found.losses.is_some());
        let has_repeats = all.clone().any(|found| found.repeat_se.is_some());
        let is_permuted = is_full && all.clone().any(|found| found.p_error.is_some());
        let has_margin = all.clone().any(|found| found.equivalence.is_some());
        let has_simultaneous = is_full && all.any(|found| found.simultaneous.is_some());
        let places = |row: &R| method(of(row).method).1;
        self.text("test", |row| method(of(row).method).0)
            .number("counts", |row| counts(of(row)))
            .number("difference", |row| fixed(of(row).difference, places(row)))
            .number("interval", |row| held(of(row).interval, of(row).withheld, places(row)))
            .number_if(has_simultaneous, "simultaneous", |row| plain(of(row).simultaneous, places(row)))
            .number_if(has_repeats, "SE of repeats", |row| fixed(of(row).repeat_se, places(row)))
            .p_values(is_full, |row| [of(row).p, of(row).mid_p, of(row).p_adjusted])
            .number_if(has_margin, "p within margin", |row| p_value(of(row).equivalence.map(|it| it.p_adjusted)))
            .number_if(is_permuted, "Monte Carlo error of p", |row| fixed(of(row).p_error, 4))
            .lost_if(has_losses, |row| of(row).losses.as_ref())
    }
}

pub(super) fn separated(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let is_permuted = statistics.models.iter().flat_map(Family::comparisons).any(|found| found.p_error.is_some());
    let by_permutation = if is_permuted { ", also by permutation at unequal n" } else { "" };
    let title = format!(
        "Models told apart: exact tests two-sided by minimum likelihood (McNemar of pairs, Fisher of independent \
         episodes), t tests of restricted means{by_permutation}; Holm over all pairs; {} intervals (Newcombe) not \
         adjusted",
        percent(statistics.confidence)
    );
    let tests = statistics.models.iter().flat_map(|family| family.tests.iter().map(move |test| (family, test)));
    let all = tests.clone().map(|(_, test)| &test.comparison);
    TextTable::of(tests.filter(|(family, test)| shown(&family.metric) && test.comparison.separated))
        .text("experiment", |(family, _)| family.experiment.clone())
        .text("metric", |(family, _)| family.metric.clone())
        .text("better", |(_, test)| test.first.clone())
        .text("than", |(_, test)| test.second.clone())
        .comparison(all, is_full, |(_, test)| &test.comparison)
        .table()
        .titled(title)
}

pub(super) fn conditions(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let all = statistics.conditions.iter().map(|contrast| &contrast.comparison);
    TextTable::of(statistics.conditions.iter().filter(|contrast| shown(&contrast.metric)))
        .text("model", |contrast| contrast.name())
        .text("metric", |contrast| contrast.metric.clone())
        .text("conditions", |contrast| format!("{} - {}", contrast.baseline, contrast.against))
        .comparison(all, is_full, |contrast| &contrast.comparison)
        .number("verdict", |contrast| match contrast.comparison.sign() {
            Some(Sign::Higher) => "higher",
            Some(Sign::Lower) => "lower",
            None if contrast.comparison.unsaid(statistics.confidence).is_some() => CANNOT_SAY,
            None if contrast.comparison.p.is_some() => "not told apart",
            None if contrast.comparison.selected.is_some() => "descriptive",
            None => UNDEFINED,
        })
        .table()
        .titled(format!(
            "Between conditions: first experiment minus the other, by the same methods; Holm over the models; {} \
             intervals not adjusted",
            percent(statistics.confidence)
        ))
}

pub(super) fn trends(statistics: &Statistics, shown: Shown) -> Table {
    TextTable::of(statistics.trends.iter().filter(|row| shown(&row.metric)))
        .text("factor", |row| row.factor.clone())
        .text("metric", |row| row.metric.clone())
        .text("model", |row| named(&row.model, row.condition.as_deref()))
        .text("rates by dose", |row| {
            let count = |dose: &Dose| format!("{}: {}/{}", dose.dose, dose.successes, dose.n);
            let rates = row.doses.iter().map(|dose| beside(&count(dose), dose.unit_mean, RATE_PLACES));
            rates.collect::<Vec<_>>().join(", ")
        })
        .number("compared within", |row| {
            row.trend.map_or_else(|| UNDEFINED.to_owned(), |trend| counted(trend.strata, singular(&row.units)))
        })
        .number("z", |row| fixed(row.trend.map(|trend| trend.z), 2))
        .number("p adjusted", |row| p_value(row.p_adjusted))
        .number("verdict", |row| match (row.trend, row.too_few(), row.verdict) {
            (None, ..) => "not tested".to_owned(),
            (_, Some(units), _) => format!("cannot say: {}", counted(units, singular(&row.units))),
            (.., Verdict::Above) => "rises".to_owned(),
            (.., Verdict::Below) => "falls".to_owned(),
            (.., Verdict::NotSeparated) => "no trend shown".to_owned(),
        })
        .table()
        .titled("Rates against a dose: Cochran-Armitage test within each scene or other unit (Mantel 1963); Holm over the models")
}

fn counts(found: &Comparison) -> String {
    let [m, n] = found.n;
    let places = method(found.method).1;
    let sides = |counts: [String; 2]| {
        let [first, second] = counts;
        let [a, b] = found.unit_means.map_or([None; 2], |means| means.map(Some));
        format!("{}, {}", beside(&first, a, places), beside(&second, b, places))
    };
    let counts = match (found.pairs.filter(|_| found.unit_means.is_none()), found.successes) {
        (Some(pairs), _) => format!("{}:{} of {}", pairs.first_only, pairs.second_only, counted(m, "pair")),
        (None, Some([k, l])) => sides([format!("{k}/{m}"), format!("{l}/{n}")]),
        _ if found.unit_means.is_some() => sides([m.to_string(), n.to_string()]),
        _ if matches!(found.method, Method::RestrictedMeanPaired | Method::StudentPaired) => counted(m, "pair"),
        _ => format!("{m}, {n}"),
    };
    counts + &of_units(found.units.as_ref())
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

pub(super) const fn overall_method(method: OverallMethod) -> &'static str {
    match method {
        OverallMethod::MantelHaenszel => "exact conditional",
        OverallMethod::PooledMcnemar => "McNemar, pooled",
        OverallMethod::Units => "by scene or cluster",
    }
}

/// Pairs of models over all experiments: all pairs if `is_full`, else only separated ones.
pub(super) fn overall(statistics: &Statistics, shown: Shown, is_full: bool) -> Table {
    let rows = statistics.overall.iter().filter(|row| shown(&row.metric) && (is_full || row.separated));
    let has_losses = rows.clone().any(|row| row.losses.is_some());
    TextTable::of(rows)
        .text("metric", |row| row.metric.clone())
        .text("first", |row| row.first.clone())
        .text("second", |row| row.second.clone())
        .text("test", |row| overall_method(row.method))
        .number("experiments", |row| row.experiments.len())
        .number("difference", |row| fixed(row.difference, 3))
        .number("interval", |row| plain(row.interval, 3))
        .p_values(is_full, |row| [row.p, row.mid_p, row.p_adjusted])
        .lost_if(has_losses, |row| row.losses.as_ref())
        .number("verdict", |row| match row.losses {
            _ if row.separated => "better",
            _ if row.is_crossed => "opposite effects",
            Some(losses) if !losses.agree => CANNOT_SAY,
            _ => "not told apart",
        })
        .table()
        .titled(format!(
            "Models over all experiments: exact conditional test with the Mantel-Haenszel difference and Klingenberg's \
             {} interval, McNemar's over the pairs of all, or permutation by scene or cluster; two-sided by minimum \
             likelihood; Holm over all pairs",
            percent(statistics.confidence)
        ))
}

pub(super) fn design(audit: &DesignAudit) -> Table {
    TextTable::of(&audit.cells)
        .text("experiment", |cell| cell.key.experiment.clone())
        .text("model", |cell| cell.key.name())
        .number("episodes", |cell| cell.episodes)
        .number("lost", |cell| cell.lost)
        .number("seeds", |cell| cell.seeds)
        .number("scenes", |cell| cell.scenes)
        .number("shared", |cell| cell.shared_scenes)
        .number("most repeats", |cell| cell.most_repeats)
        .number("unfinished", |cell| cell.unfinished.map_or_else(|| UNDEFINED.to_owned(), |count| count.to_string()))
        .number("after steps", |cell| match cell.unfinished_steps {
            None => UNDEFINED.to_owned(),
            Some([first, last]) => span(first, last),
        })
        .table()
}

/// The ranks that the tests leave open, a table per metric: models by experiments, the best first.
pub(super) fn tied(statistics: &Statistics, shown: Shown, most: usize) -> Vec<Table> {
    let metrics: IndexSet<&str> = statistics.ranks.iter().map(|row| &*row.metric).filter(|it| shown(it)).collect();
    metrics.into_iter().map(|metric| tied_under(statistics, metric, most)).collect()
}

fn tied_under(statistics: &Statistics, metric: &str, most: usize) -> Table {
    let mut ranks: IndexMap<&str, IndexMap<&str, &RankRow>> = IndexMap::new();
    for row in statistics.ranks.iter().filter(|row| row.metric == metric) {
        ranks.entry(&row.model).or_default().insert(row.experiment.as_deref().unwrap_or(ALL), row);
    }
    let columns: IndexSet<&str> = ranks.values().flat_map(|row| row.keys().copied()).collect();
    // By the mean of all ranks; the sort is stable.
    let place = |row: &IndexMap<&str, &RankRow>| {
        let sum: usize = row.values().map(|row| row.best + row.worst).sum();
        sum as f64 / row.len() as f64
    };
    ranks.sort_by(|_, a, _, b| place(a).total_cmp(&place(b)));
    let title = format!("Ranks that the tests leave open, {metric}: models that may have rank 1 are tied for the best");
    let mut table = Table::plain(&["model"], &columns.iter().copied().collect::<Vec<_>>()).titled(title);
    for (model, row) in ranks.iter().take(most) {
        let cells = columns.iter().map(|at| row.get(at).map_or_else(|| UNDEFINED.to_owned(), |row| row.interval()));
        table.push([(*model).to_owned()].into_iter().chain(cells));
    }
    if let Some(more) = ranks.len().checked_sub(most).filter(|more| *more > 0) {
        table.sentences.push(format!("{} more.", counted(more as u64, "model")));
    }
    table
}

pub(super) fn improvements(statistics: &Statistics, shown: Shown) -> Table {
    TextTable::of(statistics.improvements.iter().filter(|row| shown(&row.metric)))
        .text("metric", |row| row.metric.clone())
        .text("earlier", |row| row.first.clone())
        .text("than", |row| row.second.clone())
        .number("experiments", |row| row.experiments.len())
        .number("probability", |row| fixed(Some(row.improvement.probability), 3))
        .number("interval", |row| plain(row.improvement.interval, 3))
        .table()
        .titled(format!(
            "How often one model decides earlier than another, averaged over experiments; who never decides is the \
             latest; stratified bootstrap, {} percentile intervals",
            percent(statistics.confidence)
        ))
}

pub(super) fn clusters(statistics: &Statistics, shown: Shown) -> Table {
    let kind = |metric: &str| statistics.cells.iter().find(|cell| cell.metric == metric).map(|cell| cell.kind);
    let rows = statistics.clusters.iter().filter(|row| shown(&row.metric));
    TextTable::of(rows.map(|row| (row, if kind(&row.metric) == Some(Kind::Rate) { 3 } else { 2 })))
        .cell(|(row, _)| (&row.key, &row.metric))
        .number("seeds", |(row, _)| row.seeds)
        .number("n", |(row, _)| row.n)
        .number("mean", |(row, places)| fixed(row.mean, *places))
        .number("SE", |(row, places)| error(row.se, *places))
        .number("SE by seed", |(row, places)| error(row.by_seed.map(|found| found.se), *places))
        .number("interval by seed", |(row, places)| {
            held(row.by_seed.and_then(|found| found.interval), row.withheld, *places)
        })
        .number("ICC", |(row, _)| fixed(row.by_seed.and_then(|found| found.icc), 2))
        .number("design effect", |(row, _)| fixed(row.by_seed.and_then(|found| found.design_effect), 2))
        .table()
        .titled("By seed: cluster-robust standard errors, t(seeds - 1), of rates on the log-odds scale")
}

pub(super) fn durations(statistics: &Statistics, shown: Shown) -> Table {
    TextTable::of(statistics.durations.iter().filter(|row| shown(&row.metric)))
        .cell(|row| (&row.key, &row.metric))
        .number("finished", |row| format!("{}/{}", row.finished, row.n))
        .number("median", |row| reached(row.median))
        .number("interval", |row| match row.median_interval.map(|found| (found.low, found.high)) {
            Some((low, Some(high))) => format!("[{low}, {high}]"),
            Some((low, None)) => format!("[{low}, open)"),
            None => UNDEFINED.to_owned(),
        })
        .number("restricted mean", |row| fixed(row.restricted.map(|found| found.mean), 2))
        .number("interval", |row| held(row.restricted.and_then(|found| found.interval), row.withheld, 2))
        .number("up to", |row| row.restricted.map_or_else(|| UNDEFINED.to_owned(), |found| found.horizon.to_string()))
        .table()
        .titled(format!(
            "Durations: unfinished episodes censored (Kaplan-Meier); medians by Brookmeyer and Crowley, restricted \
             means on the log-odds scale, {} intervals",
            percent(statistics.confidence)
        ))
}

pub(super) fn correct(statistics: &Statistics, shown: Shown) -> Table {
    let percent = percent(statistics.confidence);
    let title = format!("Time to a correct decision: a wrong one competes (Aalen-Johansen); {percent} intervals");
    let rows = statistics.durations.iter().filter(|row| shown(&row.metric));
    TextTable::of(rows.filter_map(|row| Some((row, row.correct.as_ref()?))))
        .cell(|(row, _)| (&row.key, &row.metric))
        .number("correct", |(_, found)| fixed(Some(found.correct), 3))
        .number("wrong", |(_, found)| fixed(Some(found.wrong), 3))
        .number("half correct", |(_, found)| reached(found.median))
        .number("restricted mean", |(_, found)| fixed(Some(found.restricted.mean), 2))
        .number("interval", |(_, found)| held(found.restricted.interval, found.withheld, 2))
        .number("up to", |(_, found)| found.restricted.horizon)
        .table()
        .titled(title)
}

pub(super) fn retests(statistics: &Statistics, shown: Shown) -> Table {
    TextTable::of(statistics.retests.iter().filter(|row| shown(&row.metric)))
        .cell(|row| (&row.key, &row.metric))
        .number("scenes", |row| row.scenes)
        .number("episodes", |row| row.episodes)
        .number("not always the same", |row| format!("{}/{}", row.unstable, row.scenes))
        .number("flipped from one time to the next", |row| fixed(Some(row.flipped), 3))
        .number("variance by scene", |row| fixed(row.between_scenes, 3))
        .number("by repeat", |row| fixed(row.within_scenes, 3))
        .table()
        .titled("The same scene played again: verdicts that differ by chance alone, which a difference has to exceed")
}

pub(super) fn losses(statistics: &Statistics, shown: Shown) -> Table {
    TextTable::of(statistics.losses.rows.iter().filter(|row| shown(&row.metric)))
        .cell(|row| (&row.key, &row.metric))
        .number("without them", |row| format!("{}/{}", row.lossy.successes, row.lossy.n))
        .number("lost", |row| row.lossy.lost)
        .number("bounds", |row| plain(Some(row.lossy.bounds), 3))
        .number("interval around the bounds", |row| plain(Some(row.lossy.interval), 3))
        .table()
        .titled("Lost to infrastructure")
}

fn reached(median: Option<i64>) -> String {
    median.map_or_else(|| "not reached".to_owned(), |median| median.to_string())
}

pub(super) fn plain(interval: Option<Interval>, places: usize) -> String {
    bounds(interval.map(|interval| (interval.low, interval.high)), places)
}

pub(super) fn held(interval: Option<Interval>, withheld: Option<Withheld>, places: usize) -> String {
    match (interval, withheld) {
        (None, Some(Withheld::TooFew { fewest })) => format!("{UNDEFINED} (n < {fewest})"),
        (None, Some(Withheld::NoSpread)) => format!("{UNDEFINED} (no spread)"),
        (None, Some(Withheld::Selected)) => format!("{UNDEFINED} (selected)"),
        (None, Some(Withheld::Dependent)) => format!("{UNDEFINED} (repeats)"),
        (None, Some(Withheld::Incomparable)) => format!("{UNDEFINED} (not comparable)"),
        _ => plain(interval, places),
    }
}

fn error(se: Option<f64>, places: usize) -> String {
    fixed(se.filter(|&se| se > 0.0), places)
}
