//! Moments to what a cell shows, under a style's rules.

use crate::base::number::Decimal;
use crate::metric::catalog::{Kind, Metric, StandardError};
use crate::report::style::{CellForm, Print, Rounding, SingleSe};
use crate::report::table::{Spread, Value};
use crate::stats::interval::{Interval, student_t, wilson};
use crate::stats::moments::Moments;

/// The confidence of every interval that a report shows.
pub const CONFIDENCE: f64 = 0.95;

/// What the cell of `metric` with these moments shows, in a row of `episodes` episodes.
pub fn value(moments: &Moments, metric: &Metric, episodes: u64, print: &Print) -> Value {
    let places = print.decimals.of(metric.kind);
    let Some(mean) = mean(moments, print.rounding, places) else { return Value::Undefined };
    match (print.cell, metric.kind) {
        (CellForm::MeanSe, _) => Value::MeanSe { mean, se: standard_error(moments, metric.se, print, places) },
        (CellForm::CountInterval, Kind::Rate) => Value::Count {
            count: moments.sum,
            n: moments.n,
            mean,
            spread: spread(interval(moments, metric), print.rounding, places),
        },
        (CellForm::CountInterval, Kind::Quantity) => {
            let spread = if is_constant(moments) {
                Spread::AllEqual
            } else {
                spread(interval(moments, metric), print.rounding, places)
            };
            Value::Mean { mean, spread, n: (moments.n != episodes || moments.n == 1).then_some(moments.n) }
        }
    }
}

/// What an undefined cell shows where a style has it print as zero.
pub fn zero(metric: &Metric, print: &Print) -> Value {
    let zero = Decimal::zero(print.decimals.of(metric.kind));
    Value::MeanSe { mean: zero, se: Some(zero) }
}

/// The 95 % interval of a cell: Wilson's for a rate, Student's for a quantity.
///
/// `None` where it is undefined, and for a rate whose values are not 0 and 1.
pub fn interval(moments: &Moments, metric: &Metric) -> Option<Interval> {
    match metric.kind {
        Kind::Rate => wilson(u64::try_from(moments.sum).ok()?, moments.n, CONFIDENCE),
        Kind::Quantity => student_t(moments, metric.se, CONFIDENCE),
    }
}

fn mean(moments: &Moments, rounding: Rounding, places: u32) -> Option<Decimal> {
    match rounding {
        Rounding::Once => Decimal::of_ratio(moments.sum, i128::from(moments.n), places),
        Rounding::OnceBinary | Rounding::Twice => float(moments.mean()?, rounding, places),
    }
}

fn standard_error(moments: &Moments, form: StandardError, print: &Print, places: u32) -> Option<Decimal> {
    if moments.n == 1 {
        return match (print.single_se, form) {
            (SingleSe::Zero, _) | (_, StandardError::Population) => Some(Decimal::zero(places)),
            (SingleSe::Undefined, StandardError::Sample) => None,
        };
    }
    match print.rounding {
        Rounding::Once => {
            let (above, below) = moments.se_squared(form)?;
            Decimal::of_root(above, below, places)
        }
        Rounding::OnceBinary | Rounding::Twice => float(moments.se(form)?, print.rounding, places),
    }
}

fn float(value: f64, rounding: Rounding, places: u32) -> Option<Decimal> {
    match rounding {
        Rounding::Once | Rounding::OnceBinary => Decimal::of_float(value, places),
        Rounding::Twice => Decimal::of_float_twice(value, places),
    }
}

fn spread(interval: Option<Interval>, rounding: Rounding, places: u32) -> Spread {
    let bounds = interval
        .and_then(|interval| Some((float(interval.low, rounding, places)?, float(interval.high, rounding, places)?)));
    bounds.map_or(Spread::Unknown, |(low, high)| Spread::Interval { low, high })
}

/// Whether there are several values and all are the same.
fn is_constant(moments: &Moments) -> bool {
    moments.n > 1 && moments.se_squared(StandardError::Population).is_some_and(|(spread, _)| spread == 0)
}
