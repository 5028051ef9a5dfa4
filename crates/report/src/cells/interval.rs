//! The interval of a cell, the same in every output: its method, its bounds, and where it is withheld.

use exact::moments::Moments;
use metric::catalog::{Kind, Metric, PPM};
use score::table::{EpisodeTable, MetricColumn};
use statistics::coverage::{self, Withheld};
use statistics::interval::{Interval, student_t, wilson};

/// The confidence where nobody asks for another one.
pub const CONFIDENCE: f64 = 0.95;

/// Which metrics are durations that end with a decision, and which metric is defined where there was one, 1 where that
/// was correct.
///
/// The one place where statistics know a metric by name: a definition file does not say that a quantity is censored.
pub const CENSORED: [(&str, &str); 1] = [("TTD", "TSA-C")];

/// The unit of metrics that count steps.
const STEPS: &str = "steps";

/// The interval of a mean, or the reason why it has none: Wilson's for a rate, Student's for a quantity.
///
/// `range` has the least and the largest mean that the metric can have.
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

/// An interval of the mean of a quantity from `fewest` values on, within the metric's range.
pub fn bounded(
    found: Option<Interval>,
    moments: &Moments,
    range: Interval,
    fewest: u64,
) -> (Option<Interval>, Option<Withheld>) {
    let found = found.filter(|found| found.low < found.high).map(|found| found.within(range.low, range.high));
    coverage::given(found, moments.n, fewest, moments.has_spread())
}

/// The least and the largest mean that each metric of a table can have, as far as that is known.
///
/// Steps are never negative, and no more than the longest episode that ended without a decision had, which is the budget.
/// A share has no more than all. A metric with values outside counts something else, and has no such bound.
#[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
pub fn ranges(table: &EpisodeTable) -> Vec<Interval> {
    let longest = CENSORED.iter().filter_map(|(duration, finished)| {
        let (duration, finished) = (table.metric(duration)?, table.metric(finished)?);
        let unfinished = duration.iter().zip(finished.iter()).filter(|(_, finished)| finished.is_none());
        unfinished.filter_map(|(steps, _)| steps).max()
    });
    let budget = longest.max();
    let range = |column: &MetricColumn| {
        let (least, most) = match table.catalog.metric.get(&column.name) {
            Some(metric) if metric.kind == Kind::Rate => return Interval { low: 0.0, high: 1.0 },
            Some(metric) if metric.unit == PPM => (None, Some(1_000_000)),
            Some(metric) if metric.unit == STEPS => (Some(0), budget),
            _ => return Interval::UNBOUNDED,
        };
        let (least_seen, most_seen) = (column.iter().flatten().min(), column.iter().flatten().max());
        let least = least.filter(|&least| least_seen.is_none_or(|seen| seen >= least));
        let most = most.filter(|&most| most_seen.is_none_or(|seen| seen <= most));
        let Interval { low, high } = Interval::UNBOUNDED;
        Interval { low: least.map_or(low, |least: i64| least as f64), high: most.map_or(high, |most| most as f64) }
    };
    table.metrics.iter().map(range).collect()
}
