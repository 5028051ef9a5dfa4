//! Cells as Arrow columns, for other programs.

use std::sync::Arc;

use arrow::array::{ArrayRef, Decimal128Array, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow::error::ArrowError;

use super::{Cell, Cells};
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Kind, Metric};

/// One row per cell: the key columns as text (null if the key is missing), then `metric` and `unit` (text), `n`, `sum`
/// and `sum_sq` (int64; decimals where a metric has decimals), `mean`, `se` (float64; null if undefined), `interval` (text, its method), `ci_low` and
/// `ci_high` (float64). The last three are null if the interval is undefined or withheld.
pub fn record_batch(cells: &Cells) -> Result<RecordBatch, ArrowError> {
    let rows: Vec<Cell> = cells.all().collect();
    let mut columns: Vec<(&str, ArrayRef)> = Vec::new();
    for (at, name) in cells.by.iter().enumerate() {
        columns.push((name, Arc::new(rows.iter().map(|row| row.key[at].text()).collect::<StringArray>())));
    }
    let decimals = rows.iter().map(|row| row.metric.decimals).max().unwrap_or(0);
    let beyond = |name: &str| ArrowError::ComputeError(format!("the column `{name}` of cells overflows its type"));
    let exact = |name: &'static str, digits: u8, of: &dyn Fn(&Cell) -> Decimal| -> Result<_, ArrowError> {
        let values = rows.iter().map(|row| Some(of(row).with_places(digits.into())?.units()));
        let values = values.collect::<Option<Vec<i128>>>().ok_or_else(|| beyond(name))?;
        let column: ArrayRef = if digits > 0 {
            Arc::new(Decimal128Array::from(values).with_precision_and_scale(38, digits.cast_signed())?)
        } else {
            let values: Result<Vec<i64>, _> = values.into_iter().map(i64::try_from).collect();
            Arc::new(Int64Array::from(values.map_err(|_| beyond(name))?))
        };
        Ok((name, column))
    };
    let float = |of: fn(&Cell) -> Option<f64>| -> ArrayRef { Arc::new(rows.iter().map(of).collect::<Float64Array>()) };
    let texts =
        |of: fn(&Cell) -> Option<String>| -> ArrayRef { Arc::new(rows.iter().map(of).collect::<StringArray>()) };
    columns.push(("metric", texts(|row| Some(row.name.to_owned()))));
    columns.push(("unit", texts(|row| Some(row.metric.unit.clone()))));
    columns.push(exact("n", 0, &|row| Decimal::of_units(row.moments.n.into(), 0))?);
    columns.push(exact("sum", decimals, &|row| row.metric.sums(row.moments)[0])?);
    columns.push(exact("sum_sq", 2 * decimals, &|row| row.metric.sums(row.moments)[1])?);
    columns.push(("mean", float(|row| row.metric.mean(row.moments))));
    columns.push(("se", float(|row| row.metric.standard_error(row.moments))));
    columns.push(("interval", texts(|row| row.interval.map(|_| method(row.metric).to_owned()))));
    columns.push(("ci_low", float(|row| row.interval.map(|interval| row.metric.in_unit(interval.low)))));
    columns.push(("ci_high", float(|row| row.interval.map(|interval| row.metric.in_unit(interval.high)))));
    RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, column)| {
        let nullable = !matches!(name, "metric" | "unit" | "n" | "sum" | "sum_sq");
        (name, column, nullable)
    }))
}

fn method(metric: &Metric) -> &'static str {
    if metric.kind == Kind::Rate { "wilson" } else { "student_t" }
}
