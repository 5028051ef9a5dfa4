//! The interval of a cell, the same in every output: its method, its bounds, and when it is withheld.

use std::collections::BTreeMap;

use crate::tables::table::{EpisodeTable, MetricColumn};
use mirrorstats_exact::moments::Moments;
use mirrorstats_metric::catalogs::catalog::{Kind, Measures, Metric, ValueRange};
use mirrorstats_metric::catalogs::relations::Relations;
use mirrorstats_statistics::intervals::coverage::{self, Withheld};
use mirrorstats_statistics::intervals::interval::{Interval, student_t, wilson};

pub const CONFIDENCE: f64 = 0.95;

/// The interval of a mean, or the reason for its absence: Wilson's for a rate, Student's for a quantity.
///
/// `range` has the least and the largest possible mean of the metric.
pub fn cell_interval(
    moments: &Moments,
    metric: &Metric,
    range: Interval,
    confidence: f64,
) -> (Option<Interval>, Option<Withheld>) {
    if let (Kind::Rate, Some((successes, n))) = (metric.kind, moments.counts()) {
        return coverage::given(wilson(successes, n, confidence), n, 1, n > 0);
    }
    let found = student_t(moments, metric.se, confidence);
    bounded(found, moments, range, coverage::STUDENT)
}

/// An interval of the mean of a quantity, withheld below `fewest` values, within the metric's range.
pub fn bounded(
    found: Option<Interval>,
    moments: &Moments,
    range: Interval,
    fewest: u64,
) -> (Option<Interval>, Option<Withheld>) {
    let found = found.filter(|found| found.low < found.high).map(|found| found.within(range.low, range.high));
    coverage::given(found, moments.n, fewest, moments.has_spread())
}

/// The least and the largest possible mean of each metric of a table, as far as known.
///
/// A definition or the unit gives the range of values. A count in the unit of a censored duration is at most the
/// budget, the length of the longest unfinished episode. A metric with values outside counts something else, and has no
/// such bound.
#[expect(clippy::cast_precision_loss, reason = "values of a metric are far below 2^53")]
pub fn ranges(table: &EpisodeTable) -> Vec<Interval> {
    let budgets = budgets(table);
    let range = |column: &MetricColumn| {
        let Some(metric) = table.catalog.metric.get(&column.name) else { return Interval::UNBOUNDED };
        let ValueRange { least, most } = metric.value_range();
        let budget = || budgets.get(&(metric.unit.as_str(), metric.decimals)).copied();
        let most = match metric.measures() {
            Some(Measures::Count | Measures::Duration) => most.or_else(budget),
            _ => most,
        };
        let (least_seen, most_seen) = (column.iter().flatten().min(), column.iter().flatten().max());
        let least = least.filter(|&least| least_seen.is_none_or(|seen| seen >= least));
        let most = most.filter(|&most| most_seen.is_none_or(|seen| seen <= most));
        let Interval { low, high } = Interval::UNBOUNDED;
        Interval { low: least.map_or(low, |least| least as f64), high: most.map_or(high, |most| most as f64) }
    };
    table.metrics.iter().map(range).collect()
}

/// The length of the longest unfinished episode, by the unit and the decimals of the duration.
fn budgets(table: &EpisodeTable) -> BTreeMap<(&str, u8), i64> {
    let mut budgets = BTreeMap::new();
    for (duration, finished) in &Relations::of(&table.catalog).durations {
        let (Some(metric), Some(steps), Some(finished)) =
            (table.catalog.metric.get(duration), table.metric(duration), table.metric(finished))
        else {
            continue;
        };
        let unfinished = steps.iter().zip(finished.iter()).filter(|(_, finished)| finished.is_none());
        if let Some(longest) = unfinished.filter_map(|(steps, _)| steps).max() {
            let budget = budgets.entry((metric.unit.as_str(), metric.decimals)).or_insert(longest);
            *budget = longest.max(*budget);
        }
    }
    budgets
}
