//! Parquet of any shape: one row per step, with values as in JSON.

use std::fs::File;

use arrow::array::RecordBatch;
use arrow::json::WriterBuilder;
use arrow::json::writer::LineDelimited;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Map, Value};

use super::RowSink;
use crate::catch_panic::contained;
use crate::import::error::ImportError;

const BATCH: usize = 1024;

pub(super) fn read(file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    each_row(file, rows, |row, rows| rows.add_object(&row))
}

pub(super) fn each_row(
    file: File,
    rows: &mut RowSink<'_>,
    add: impl FnMut(Map<String, Value>, &mut RowSink<'_>) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    each_row_of(file, rows, &[], add)
}

/// The same for these columns only; all columns if the list is empty.
pub(super) fn each_row_of(
    file: File,
    rows: &mut RowSink<'_>,
    columns: &[&str],
    mut add: impl FnMut(Map<String, Value>, &mut RowSink<'_>) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let damaged = |rows: &RowSink<'_>, found: String| {
        rows.fault("", "a Parquet file whose values JSON can hold", found, "write the file anew, or as JSON Lines")
    };
    let opened = contained(|| {
        let opened = ParquetRecordBatchReaderBuilder::try_new(file)?.with_batch_size(BATCH);
        let mask = match columns {
            [] => ProjectionMask::all(),
            names => ProjectionMask::columns(opened.parquet_schema(), names.iter().copied()),
        };
        opened.with_projection(mask).build()
    });
    let opened = opened.and_then(|opened| opened.map_err(|error| error.to_string()));
    let mut batches = opened.map_err(|found| damaged(rows, found))?;
    loop {
        let batch = contained(|| batches.next().map(|batch| batch.and_then(|batch| lines(&batch))).transpose());
        let batch = batch.and_then(|batch| batch.map_err(|error| error.to_string()));
        let Some(lines) = batch.map_err(|found| damaged(rows, found))? else { return Ok(()) };
        for line in lines.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
            let row = serde_json::from_slice(line).map_err(|error| damaged(rows, error.to_string()))?;
            add(row, rows)?;
        }
    }
}

fn lines(batch: &RecordBatch) -> Result<Vec<u8>, arrow::error::ArrowError> {
    let mut lines = Vec::new();
    let mut writer = WriterBuilder::new().with_explicit_nulls(true).build::<_, LineDelimited>(&mut lines);
    writer.write(batch)?;
    writer.finish()?;
    drop(writer);
    Ok(lines)
}
