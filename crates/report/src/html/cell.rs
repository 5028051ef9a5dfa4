//! One table cell on the page: the printed value, and the full value in attributes.
//!
//! Rule: the attributes have the text of `cells.csv`, empty for undefined; a missing value that a style prints as zero
//! keeps its empty attributes.

use serde_json::{Value as Json, json};

use crate::cells;
use crate::layout::{MetricCell, Value};
use crate::tables::{DAGGER, Emphasis};
use exact::escape::visible;
use exact::moments::Moments;
use exact::number::{Decimal, full_precision};
use exact::ratio::Ratio;
use metric::catalog::{Kind, Metric};
use statistics::interval::Interval;

pub(super) fn cell(cell: &MetricCell, of: cells::Cell, undefined: &str, chance: Option<Ratio>) -> Json {
    let cells::Cell { name, metric, moments, interval, .. } = of;
    let (estimate, detail) = cell.value.parts(&visible(undefined));
    let of = |value: Option<f64>| value.map(full_precision).unwrap_or_default();
    json!({
        "metric": visible(name),
        "estimate": estimate,
        // The uncertainty; empty without one.
        "detail": detail.unwrap_or_default(),
        // True if it shows a missing value; a zero that a style prints instead does not count.
        "is_undefined": cell.value == Value::Undefined,
        // True if emphasis covers the detail too.
        "is_whole": matches!(cell.value, Value::MeanSe { .. }),
        "element": element(cell.emphasis),
        "mark": if cell.is_marked { DAGGER.to_string() } else { String::new() },
        "n": moments.n,
        "sum": moments.sum.to_string(),
        "sum_sq": moments.sum_sq.to_string(),
        "mean": of(moments.mean()),
        "se": of(moments.se(metric.se)),
        "ci_low": of(interval.map(|i| i.low)),
        "ci_high": of(interval.map(|i| i.high)),
        "chance": chance.map(|level| level.to_string()).unwrap_or_default(),
        "strip": strip(metric, moments, interval),
    })
}

fn element(emphasis: Emphasis) -> &'static str {
    match emphasis {
        Emphasis::Plain => "span",
        Emphasis::Bold => "strong",
        Emphasis::Underline => "u",
    }
}

fn strip(metric: &Metric, moments: &Moments, interval: Option<Interval>) -> Option<Json> {
    let place = |share: f64| Decimal::of_float(share, 3).map(Decimal::compact);
    let Interval { low, high } = interval.filter(|_| metric.kind == Kind::Rate)?;
    Some(json!({ "low": place(low)?, "width": place(high - low)?, "mean": place(moments.mean()?)? }))
}
