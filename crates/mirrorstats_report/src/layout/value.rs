//! From moments to displayed values, under a style's rules.

use super::{Spread, Value};
use crate::style::{CellForm, Print, Rounding, SingleSe};
use mirrorstats_exact::moments::Moments;
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Kind, Metric, StandardError};
use mirrorstats_score::cells::Cell;
use mirrorstats_statistics::intervals::interval::Interval;

pub fn value(cell: &Cell, episodes: u64, print: &Print) -> Value {
    let Cell { moments, metric, interval, .. } = *cell;
    let (whole, places) = scale(metric, print);
    let Some(mean) = mean(moments, print.rounding, whole, places) else { return Value::Undefined };
    let spread = || spread(interval, print.rounding, (whole, places));
    match (print.cell, metric.kind) {
        (CellForm::MeanSe, _) => Value::MeanSe { mean, se: standard_error(moments, metric.se, print, (whole, places)) },
        (CellForm::CountInterval, Kind::Rate) => {
            Value::Count { count: moments.sum, n: moments.n, mean, spread: spread() }
        }
        (CellForm::CountInterval, Kind::Quantity) => {
            let spread = if moments.n > 1 && !moments.has_spread() { Spread::AllEqual } else { spread() };
            Value::Mean { mean, spread, n: (moments.n != episodes || spread == Spread::Unknown).then_some(moments.n) }
        }
    }
}

/// The mean before it is rounded, and the digits to which it is.
pub(super) fn unrounded_mean(cell: &Cell, print: &Print) -> Option<(f64, u32)> {
    let (whole, places) = scale(cell.metric, print);
    Some((cell.moments.mean()? / float_of(whole), places))
}

/// The value of an undefined cell if a style prints it as zero.
pub(crate) fn zero(metric: &Metric, print: &Print) -> Value {
    let zero = Decimal::zero(scale(metric, print).1);
    Value::MeanSe { mean: zero, se: Some(zero) }
}

fn scale(metric: &Metric, print: &Print) -> (i128, u32) {
    match metric.whole() {
        Some(whole) => (whole.into(), print.decimals.of(Kind::Rate)),
        None => (metric.scale().into(), print.decimals.of(metric.kind).max(metric.decimals.into())),
    }
}

#[expect(clippy::cast_precision_loss, reason = "the whole of a fraction and a power of ten are far below 2^53")]
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
