//! One cell of a table as the page shows it: the printed value, and the full one in attributes.
//!
//! Rule: the attributes have the text of `cells.csv`, empty for undefined; a cell that a style prints as zero for
//! want of a value keeps its empty attributes.

use serde::Serialize;

use crate::base::number::{Decimal, full_precision};
use crate::base::visible::visible;
use crate::cells::interval::Interval;
use crate::cells::moments::Moments;
use crate::metric::catalog::{Catalog, Kind, Metric};
use crate::report::table::{Cell, DAGGER, Emphasis, Value};
use crate::report::value::interval;

/// A cell for the templates.
#[derive(Debug, Serialize)]
pub(super) struct CellView {
    /// The metric's name as an attribute and as text.
    metric: String,
    /// The part that is the estimate.
    estimate: String,
    /// The part that says how sure it is; empty for none.
    detail: String,
    /// Whether it shows that there is no value; a zero that a style prints in its place is no such cell.
    is_undefined: bool,
    /// Whether emphasis covers the detail too.
    is_whole: bool,
    /// The element that spells its emphasis.
    element: &'static str,
    /// The dagger, or empty.
    mark: String,
    n: u64,
    sum: String,
    sum_sq: String,
    mean: String,
    se: String,
    ci_low: String,
    ci_high: String,
    /// The value of blind guessing, as written; empty for none.
    chance: String,
    /// Where its interval lies between 0 and 1; none for a quantity.
    strip: Option<Strip>,
}

/// The place of an interval on the scale of rates, for the eye alone.
#[derive(Debug, Serialize)]
struct Strip {
    low: String,
    width: String,
    mean: String,
}

impl CellView {
    /// The cell of `metric` in a row of `experiment`, if its row is of one.
    pub(super) fn new(
        cell: &Cell,
        (name, metric): (&str, &Metric),
        moments: &Moments,
        undefined: &str,
        chance: Option<String>,
    ) -> Self {
        let (estimate, detail) = cell.value.parts(&visible(undefined));
        let interval = interval(moments, metric);
        let of = |value: Option<f64>| value.map(full_precision).unwrap_or_default();
        Self {
            metric: visible(name),
            estimate,
            detail: detail.unwrap_or_default(),
            is_undefined: cell.value == Value::Undefined,
            is_whole: matches!(cell.value, Value::MeanSe { .. }),
            element: element(cell.emphasis),
            mark: if cell.is_marked { DAGGER.to_string() } else { String::new() },
            n: moments.n,
            sum: moments.sum.to_string(),
            sum_sq: moments.sum_sq.to_string(),
            mean: of(moments.mean()),
            se: of(moments.se(metric.se)),
            ci_low: of(interval.map(|i| i.low)),
            ci_high: of(interval.map(|i| i.high)),
            chance: chance.unwrap_or_default(),
            strip: strip(metric, moments, interval),
        }
    }
}

fn element(emphasis: Emphasis) -> &'static str {
    match emphasis {
        Emphasis::Plain => "span",
        Emphasis::Bold => "strong",
        Emphasis::Underline => "u",
    }
}

/// The level of blind guessing in a row that is of one experiment.
pub(super) fn chance(catalog: &Catalog, experiment: Option<&str>, metric: &str) -> Option<String> {
    catalog.chance(experiment?, metric).map(|level| level.to_string())
}

/// Three digits are finer than a pixel.
fn strip(metric: &Metric, moments: &Moments, interval: Option<Interval>) -> Option<Strip> {
    let place = |share: f64| Decimal::of_float(share, 3).map(Decimal::compact);
    let Interval { low, high } = interval.filter(|_| metric.kind == Kind::Rate)?;
    Some(Strip { low: place(low)?, width: place(high - low)?, mean: place(moments.mean()?)? })
}
