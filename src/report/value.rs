//! Moments to what a cell shows, under a style's rules.

use crate::base::number::Decimal;
use crate::metric::catalog::{Kind, Metric, PPM, StandardError};
use crate::report::style::{CellForm, Print, Rounding, SingleSe};
use crate::report::table::{Spread, Value};
use crate::stats::interval::{Interval, student_t, wilson};
use crate::stats::moments::Moments;

/// The confidence of every interval that a report shows.
pub const CONFIDENCE: f64 = 0.95;

const MILLION: i128 = 1_000_000;

/// What the cell of `metric` with these moments shows, in a row of `episodes` episodes.
pub fn value(moments: &Moments, metric: &Metric, episodes: u64, print: &Print) -> Value {
    let (whole, places) = scale(metric, print);
    let Some(mean) = mean(moments, print.rounding, whole, places) else { return Value::Undefined };
    match (print.cell, metric.kind) {
        (CellForm::MeanSe, _) => Value::MeanSe { mean, se: standard_error(moments, metric.se, print, (whole, places)) },
        (CellForm::CountInterval, Kind::Rate) => Value::Count {
            count: moments.sum,
            n: moments.n,
            mean,
            spread: spread(interval(moments, metric), print.rounding, (whole, places)),
        },
        (CellForm::CountInterval, Kind::Quantity) => {
            let spread = if is_constant(moments) {
                Spread::AllEqual
            } else {
                spread(interval(moments, metric), print.rounding, (whole, places))
            };
            Value::Mean { mean, spread, n: (moments.n != episodes || moments.n == 1).then_some(moments.n) }
        }
    }
}

/// What an undefined cell shows where a style has it print as zero.
pub fn zero(metric: &Metric, print: &Print) -> Value {
    let zero = Decimal::zero(scale(metric, print).1);
    Value::MeanSe { mean: zero, se: Some(zero) }
}

/// The 95 % interval of a cell: Wilson's for a rate, Student's for a quantity.
///
/// `None` where it is undefined, and for a rate whose values are not 0 and 1.
pub fn interval(moments: &Moments, metric: &Metric) -> Option<Interval> {
    match metric.kind {
        Kind::Rate => wilson(u64::try_from(moments.sum).ok()?, moments.n, CONFIDENCE),
        // No share is more than all.
        Kind::Quantity if metric.unit == PPM => {
            Some(student_t(moments, metric.se, CONFIDENCE)?.within(f64::NEG_INFINITY, float_of(MILLION)))
        }
        Kind::Quantity => student_t(moments, metric.se, CONFIDENCE),
    }
}

/// What a value of one is, and the decimals: shares in parts per million are shown as rates are.
fn scale(metric: &Metric, print: &Print) -> (i128, u32) {
    if metric.unit == PPM { (MILLION, print.decimals.of(Kind::Rate)) } else { (1, print.decimals.of(metric.kind)) }
}

/// One of the two scales, which are small.
#[expect(clippy::cast_precision_loss, reason = "a million is exact")]
const fn float_of(whole: i128) -> f64 {
    whole as f64
}

fn mean(moments: &Moments, rounding: Rounding, whole: i128, places: u32) -> Option<Decimal> {
    match rounding {
        Rounding::Once => Decimal::of_ratio(moments.sum, i128::from(moments.n).checked_mul(whole)?, places),
        Rounding::OnceBinary | Rounding::Twice => float(moments.mean()? / float_of(whole), rounding, places),
    }
}

fn standard_error(moments: &Moments, form: StandardError, print: &Print, scale: (i128, u32)) -> Option<Decimal> {
    let (whole, places) = scale;
    if moments.n == 1 {
        return match (print.single_se, form) {
            (SingleSe::Zero, _) | (_, StandardError::Population) => Some(Decimal::zero(places)),
            (SingleSe::Undefined, StandardError::Sample) => None,
        };
    }
    match print.rounding {
        Rounding::Once => {
            let (above, below) = moments.se_squared(form)?;
            Decimal::of_root(above, below.checked_mul(whole * whole)?, places)
        }
        Rounding::OnceBinary | Rounding::Twice => float(moments.se(form)? / float_of(whole), print.rounding, places),
    }
}

fn float(value: f64, rounding: Rounding, places: u32) -> Option<Decimal> {
    match rounding {
        Rounding::Once | Rounding::OnceBinary => Decimal::of_float(value, places),
        Rounding::Twice => Decimal::of_float_twice(value, places),
    }
}

fn spread(interval: Option<Interval>, rounding: Rounding, (whole, places): (i128, u32)) -> Spread {
    let bound = |value: f64| float(value / float_of(whole), rounding, places);
    let bounds = interval.and_then(|interval| Some((bound(interval.low)?, bound(interval.high)?)));
    bounds.map_or(Spread::Unknown, |(low, high)| Spread::Interval { low, high })
}

/// Whether there are several values and all are the same.
fn is_constant(moments: &Moments) -> bool {
    moments.n > 1 && moments.se_squared(StandardError::Population).is_some_and(|(spread, _)| spread == 0)
}
