//! Cells as Arrow columns, for other programs.

use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow::error::ArrowError;

use super::{Cell, Cells, KeyValue};
use mirrorstats_exact::moments::Moments;
use mirrorstats_metric::catalogs::catalog::{Kind, Metric};

/// One row per cell: the key columns as text (null if the key is missing), then `metric` and `unit` (text), `n`, `sum`
/// and `sum_sq` (int64), `mean`, `se` (float64; null if undefined), `interval` (text, its method), `ci_low` and
/// `ci_high` (float64). The last three are null if the interval is undefined or withheld.
pub fn record_batch(cells: &Cells) -> Result<RecordBatch, ArrowError> {
    let rows: Vec<Cell> = cells.all().collect();
    let mut columns: Vec<(&str, ArrayRef)> = Vec::new();
    for (at, name) in cells.by.iter().enumerate() {
        columns.push((name, Arc::new(rows.iter().map(|row| text(&row.key[at])).collect::<StringArray>())));
    }
    let int = |name: &'static str, of: fn(&Moments) -> i128| -> Result<(&str, ArrayRef), ArrowError> {
        let values: Result<Vec<i64>, _> = rows.iter().map(|row| i64::try_from(of(row.moments))).collect();
        let beyond = |_| ArrowError::ComputeError(format!("the column `{name}` of cells overflows 64 bits"));
        Ok((name, Arc::new(Int64Array::from(values.map_err(beyond)?))))
    };
    let float = |of: fn(&Cell) -> Option<f64>| -> ArrayRef { Arc::new(rows.iter().map(of).collect::<Float64Array>()) };
    let texts =
        |of: fn(&Cell) -> Option<String>| -> ArrayRef { Arc::new(rows.iter().map(of).collect::<StringArray>()) };
    columns.push(("metric", texts(|row| Some(row.name.to_owned()))));
    columns.push(("unit", texts(|row| Some(row.metric.unit.clone()))));
    columns.push(int("n", |moments| moments.n.into())?);
    columns.push(int("sum", |moments| moments.sum)?);
    columns.push(int("sum_sq", |moments| moments.sum_sq)?);
    columns.push(("mean", float(|row| row.moments.mean())));
    columns.push(("se", float(|row| row.moments.se(row.metric.se))));
    columns.push(("interval", texts(|row| row.interval.map(|_| method(row.metric).to_owned()))));
    columns.push(("ci_low", float(|row| row.interval.map(|interval| interval.low))));
    columns.push(("ci_high", float(|row| row.interval.map(|interval| interval.high))));
    RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, column)| {
        let nullable = !matches!(name, "metric" | "unit" | "n" | "sum" | "sum_sq");
        (name, column, nullable)
    }))
}

fn method(metric: &Metric) -> &'static str {
    if metric.kind == Kind::Rate { "wilson" } else { "student_t" }
}

fn text(key: &KeyValue) -> Option<String> {
    match key {
        KeyValue::Missing => None,
        other => Some(other.to_string()),
    }
}
