//! The episode table as Arrow columns, for other programs.

use std::ops::Range;
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray as _, DictionaryArray, Int32Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Decimal128Type, Field, Int64Type, Schema};
use arrow::error::ArrowError;

use crate::tables::table::{EpisodeTable, Header, TextColumn};
use mirrorstats_metric::catalogs::catalog::Catalog;

pub const KEYS: [&str; 5] = ["episode_id", "model", "experiment", "seed", "run"];

/// One row per episode, as `score` writes it: `episode_id`, `model`, `experiment` (text), `seed`, `run` (int32),
/// further key columns (text, nullable), then one column per metric (int64; null if undefined, a rate is 0 or 1; a
/// decimal with 18 digits where the metric has decimals).
pub fn record_batch(table: &EpisodeTable) -> Result<RecordBatch, ArrowError> {
    let schema = Arc::new(schema(&table.header()));
    let columns = (0..schema.fields().len()).map(|column| values(table, column, 0..table.len()));
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    RecordBatch::try_new(schema, columns)
}

pub(crate) fn schema(header: &Header) -> Schema {
    let keys = KEYS.iter().zip([DataType::Utf8, DataType::Utf8, DataType::Utf8, DataType::Int32, DataType::Int32]);
    let keys = keys.map(|(name, ty)| Field::new(*name, ty, false));
    let labels = header.labels.iter().map(|name| Field::new(name, DataType::Utf8, true));
    let metrics = header.metrics.iter().map(|name| Field::new(name, metric_type(&header.catalog, name), true));
    Schema::new(keys.chain(labels).chain(metrics).collect::<Vec<_>>())
}

/// The most digits of a stored value: those of 64 bits.
const MOST_DIGITS: u8 = 18;

/// The type of a metric's column: integers, or decimals with the digits of the metric.
pub(crate) fn metric_type(catalog: &Catalog, metric: &str) -> DataType {
    match catalog.metric.get(metric).map_or(0, |metric| metric.decimals) {
        0 => DataType::Int64,
        decimals => DataType::Decimal128(MOST_DIGITS, decimals.cast_signed()),
    }
}

/// The texts of a column of the schema; `None` for a numeric column.
pub(crate) fn texts(table: &EpisodeTable, column: usize) -> Option<&TextColumn> {
    let EpisodeTable { keys, labels, .. } = table;
    match column {
        0 => Some(&keys.episode_id),
        1 => Some(&keys.model),
        2 => Some(&keys.experiment),
        other => labels.get(other.checked_sub(KEYS.len())?).map(|label| &label.values),
    }
}

pub(crate) fn values(table: &EpisodeTable, column: usize, rows: Range<usize>) -> Result<ArrayRef, ArrowError> {
    if let Some(texts) = texts(table, column) {
        return texts_of(texts, rows);
    }
    let EpisodeTable { keys, labels, metrics, .. } = table;
    let number = |numbers: &Int32Array| Arc::new(numbers.slice(rows.start, rows.len())) as ArrayRef;
    Ok(match column {
        3 => number(&keys.seed),
        4 => number(&keys.run),
        other => {
            let metric = &metrics[other - KEYS.len() - labels.len()];
            let stored = cast(&metric.array().slice(rows.start, rows.len()), &DataType::Int64)?;
            match metric_type(&table.catalog, &metric.name) {
                DataType::Decimal128(digits, decimals) => {
                    let units = stored.as_primitive::<Int64Type>().unary::<_, Decimal128Type>(i128::from);
                    Arc::new(units.with_precision_and_scale(digits, decimals)?)
                }
                _ => stored,
            }
        }
    })
}

/// The same for the Parquet library: texts as codes, without a copy of the text per row.
pub(crate) fn coded_values(table: &EpisodeTable, column: usize, rows: Range<usize>) -> Result<ArrayRef, ArrowError> {
    let Some(texts) = texts(table, column) else { return values(table, column, rows) };
    let codes = texts.codes.slice(rows.start, rows.len());
    Ok(Arc::new(DictionaryArray::try_new(codes, Arc::new(texts.texts.clone()))?))
}

fn texts_of(column: &TextColumn, rows: Range<usize>) -> Result<ArrayRef, ArrowError> {
    let bytes: usize = rows.clone().filter_map(|row| column.get(row)).map(str::len).sum();
    if i32::try_from(bytes).is_err() {
        return Err(ArrowError::OffsetOverflowError(bytes));
    }
    Ok(Arc::new(rows.map(|row| column.get(row)).collect::<StringArray>()))
}
