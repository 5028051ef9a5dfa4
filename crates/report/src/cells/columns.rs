//! Cells as Arrow columns, for programs that go on with them.

use std::sync::Arc;

use arrow::array::{ArrayRef, Decimal128Array, Float64Array, RecordBatch, StringArray, UInt64Array};
use arrow::error::ArrowError;

use super::{Cell, Cells, KeyValue};
use exact::moments::Moments;

/// Digits of the sums: 38 is the most that 128 bits hold.
const DIGITS: u8 = 38;

/// One row per cell: the key columns as text (null where the key is missing), then `metric`, `n` (uint64), `sum` and
/// `sum_sq` (decimal), `mean`, `se`, `ci_low`, `ci_high` (float64; null where undefined or withheld).
///
/// # Errors
/// A sum of more than 38 digits.
pub fn record_batch(cells: &Cells) -> Result<RecordBatch, ArrowError> {
    let rows: Vec<Cell> = cells.all().collect();
    let mut columns: Vec<(&str, ArrayRef)> = Vec::new();
    for (at, name) in cells.by.iter().enumerate() {
        columns.push((name, Arc::new(rows.iter().map(|row| text(&row.key[at])).collect::<StringArray>())));
    }
    let decimal = |of: fn(&Moments) -> i128| -> Result<ArrayRef, ArrowError> {
        let values = Decimal128Array::from_iter_values(rows.iter().map(|row| of(row.moments)));
        let values = values.with_precision_and_scale(DIGITS, 0)?;
        values.validate_decimal_precision(DIGITS)?;
        Ok(Arc::new(values))
    };
    let float = |of: fn(&Cell) -> Option<f64>| -> ArrayRef { Arc::new(rows.iter().map(of).collect::<Float64Array>()) };
    columns.push(("metric", Arc::new(StringArray::from_iter_values(rows.iter().map(|row| row.name)))));
    columns.push(("n", Arc::new(UInt64Array::from_iter_values(rows.iter().map(|row| row.moments.n)))));
    columns.push(("sum", decimal(|moments| moments.sum)?));
    columns.push(("sum_sq", decimal(|moments| moments.sum_sq)?));
    columns.push(("mean", float(|row| row.moments.mean())));
    columns.push(("se", float(|row| row.moments.se(row.metric.se))));
    columns.push(("ci_low", float(|row| row.interval.map(|interval| interval.low))));
    columns.push(("ci_high", float(|row| row.interval.map(|interval| interval.high))));
    RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, column)| {
        let nullable = !matches!(name, "metric" | "n" | "sum" | "sum_sq");
        (name, column, nullable)
    }))
}

fn text(key: &KeyValue) -> Option<String> {
    match key {
        KeyValue::Missing => None,
        other => Some(other.to_string()),
    }
}
