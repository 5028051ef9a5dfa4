//! Decodes a row group into rows of few types: bool, integer (64 bits), float (64 bits), text (a dictionary).
//!
//! Rule: whatever bytes a file holds, decoding gives rows or a finding, never a panic.

use std::fs::File;
use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, AsArray as _, new_null_array};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int32Type, Int64Type, UInt64Type};
use arrow::record_batch::RecordBatch;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};

use super::contain::contained;
use super::finding::{Code, Finding};
use super::layout::{EPISODE_ID, Layout, T};
use super::open::{TraceFile, plain, text_type};
use super::schema::Kind;

/// Rows that are decoded at a time.
const BATCH_ROWS: usize = 64 * 1024;

/// Some rows of one row group: a column for each of the layout, in its order.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    pub(super) columns: Vec<ArrayRef>,
    pub(super) row_group: usize,
    /// Where they start in the row group.
    pub(super) first: usize,
}

impl Rows {
    pub(super) fn len(&self) -> usize {
        self.columns[T].len()
    }

    /// `length` rows from row `start`; nothing is copied.
    pub(super) fn slice(&self, start: usize, length: usize) -> Self {
        let columns = self.columns.iter().map(|column| column.slice(start, length)).collect();
        Self { columns, row_group: self.row_group, first: self.first + start }
    }

    /// The episode of a row.
    pub(super) fn episode(&self, row: usize) -> Option<&str> {
        text_at(&self.columns[EPISODE_ID], row)
    }
}

/// The text at a row of a text column; `None` for null.
pub(super) fn text_at(column: &ArrayRef, row: usize) -> Option<&str> {
    let column = column.as_dictionary::<Int32Type>();
    Some(column.values().as_string::<i32>().value(column.key(row)?))
}

/// The rows of one row group, in order, until its end or its first fault.
pub(super) struct RowGroup<'a> {
    file: &'a TraceFile,
    layout: &'a Layout,
    index: usize,
    /// Where each column of the layout is among the decoded ones; `None` for one that the file has not.
    places: Vec<Option<usize>>,
    /// `None` once it has nothing more to give.
    reader: Option<ParquetRecordBatchReader>,
    first: usize,
}

impl<'a> RowGroup<'a> {
    pub(super) fn open(file: &'a TraceFile, layout: &'a Layout, row_group: usize) -> Result<Self, Box<Finding>> {
        let roots: Vec<Option<usize>> = layout
            .columns
            .iter()
            .map(|wanted| file.columns().iter().position(|column| column.name == wanted.name))
            .collect();
        let mut read: Vec<usize> = roots.iter().flatten().copied().collect();
        read.sort_unstable();
        let places = roots.iter().map(|root| root.and_then(|root| read.binary_search(&root).ok())).collect();
        let handle = file.reader().map_err(|error| {
            Box::new(Finding::new(Code::Unreadable, file.name(), "a file that can be read", error.to_string()))
        })?;
        let reader = contained(|| reader(file, handle, read, row_group))
            .and_then(|made| made.map_err(|error| plain(&error)))
            .map_err(|error| corrupt(file, row_group, &error))?;
        Ok(Self { file, layout, index: row_group, places, reader: Some(reader), first: 0 })
    }

    fn decode(&mut self) -> Result<Option<Rows>, Box<Finding>> {
        let Some(reader) = &mut self.reader else { return Ok(None) };
        let batch = contained(|| reader.next())
            .and_then(|next| next.transpose().map_err(|error| error.to_string()))
            .map_err(|error| corrupt(self.file, self.index, &error))?;
        let expected = self.file.row_group_rows(self.index);
        match batch {
            Some(batch) if self.first + batch.num_rows() <= expected => self.normal(&batch).map(Some),
            None if self.first == expected => Ok(None),
            surplus => {
                let found = self.first + surplus.map_or(0, |batch| batch.num_rows());
                let finding =
                    Finding::new(Code::CorruptData, self.file.name(), format!("{expected} rows"), format!("{found}"));
                Err(Box::new(finding.in_row_group(self.index)))
            }
        }
    }

    fn normal(&mut self, batch: &RecordBatch) -> Result<Rows, Box<Finding>> {
        let length = batch.num_rows();
        let normal = |(i, place): (usize, &Option<usize>)| {
            let kind = self.layout.columns[i].kind;
            match place {
                None => Ok(new_null_array(&held_as(kind), length)),
                Some(place) => contained(|| normal_column(batch.column(*place), kind))
                    .unwrap_or_else(|panic| Err(Refused::Unreadable(panic)))
                    .map_err(|refused| self.refusal(refused, i, batch)),
            }
        };
        let columns = self.places.iter().enumerate().map(normal).collect::<Result<_, _>>()?;
        let rows = Rows { columns, row_group: self.index, first: self.first };
        self.first += length;
        Ok(rows)
    }

    fn refusal(&self, refused: Refused, column: usize, batch: &RecordBatch) -> Box<Finding> {
        let at_column = |finding: Finding| Box::new(finding.in_column(&self.layout.columns[column].name));
        match refused {
            Refused::Unreadable(why) => at_column(*corrupt(self.file, self.index, &why)),
            Refused::TooLarge { row, value } => {
                let expected = format!("a number up to {}", i64::MAX);
                let finding = Finding::new(Code::OutOfRange, self.file.name(), expected, value.to_string());
                let held = |column: usize| {
                    let place = self.places[column]?;
                    normal_column(batch.column(place), self.layout.columns[column].kind).ok()
                };
                let mut finding = finding.in_row_group(self.index);
                finding.episode = held(EPISODE_ID).and_then(|ids| text_at(&ids, row).map(str::to_owned));
                let t = held(T).map(|t| t.as_primitive::<Int64Type>().clone());
                at_column(finding.at(t.filter(|t| t.is_valid(row)).map(|t| t.value(row))))
            }
        }
    }
}

impl Iterator for RowGroup<'_> {
    type Item = Result<Rows, Box<Finding>>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.decode().transpose();
        if !matches!(next, Some(Ok(_))) {
            self.reader = None;
        }
        next
    }
}

fn reader(
    file: &TraceFile,
    handle: File,
    roots: Vec<usize>,
    row_group: usize,
) -> parquet::errors::Result<ParquetRecordBatchReader> {
    let metadata = file.reader_metadata();
    let rows = file.row_group_rows(row_group);
    ParquetRecordBatchReaderBuilder::new_with_metadata(handle, metadata.clone())
        .with_row_groups(vec![row_group])
        .with_projection(ProjectionMask::roots(metadata.parquet_schema(), roots))
        .with_batch_size(rows.clamp(1, BATCH_ROWS))
        .build()
}

fn corrupt(file: &TraceFile, row_group: usize, found: &str) -> Box<Finding> {
    let found = found.split_whitespace().collect::<Vec<_>>().join(" ");
    Box::new(Finding::new(Code::CorruptData, file.name(), "data that decodes", found).in_row_group(row_group))
}

/// How a column of this kind is held in memory.
pub(super) fn held_as(kind: Kind) -> DataType {
    match kind {
        Kind::Bool => DataType::Boolean,
        Kind::Int => DataType::Int64,
        Kind::Float => DataType::Float64,
        Kind::String => text_type(),
        Kind::Unsupported => DataType::Null,
    }
}

/// Why a decoded column is not taken.
enum Refused {
    Unreadable(String),
    TooLarge { row: usize, value: u64 },
}

fn normal_column(column: &ArrayRef, kind: Kind) -> Result<ArrayRef, Refused> {
    let held = held_as(kind);
    match column.data_type() {
        same if *same == held => {
            if kind == Kind::String {
                check_keys(column)?;
            }
            Ok(Arc::clone(column))
        }
        DataType::Null => Ok(new_null_array(&held, column.len())),
        DataType::UInt64 => {
            let values = column.as_primitive::<UInt64Type>();
            let too_large =
                (0..values.len()).find(|row| values.is_valid(*row) && i64::try_from(values.value(*row)).is_err());
            match too_large {
                Some(row) => Err(Refused::TooLarge { row, value: values.value(row) }),
                None => cast(column, &held).map_err(|error| Refused::Unreadable(error.to_string())),
            }
        }
        _ => cast(column, &held).map_err(|error| Refused::Unreadable(error.to_string())),
    }
}

/// Every key that is not null leads to a value that is not null.
fn check_keys(column: &ArrayRef) -> Result<(), Refused> {
    let column = column.as_dictionary::<Int32Type>();
    let count = column.values().len();
    let within = |key: i32| usize::try_from(key).is_ok_and(|key| key < count);
    // What stands in the place of nulls is nearly always within, too, and then there is no need to look at them.
    let good = column.values().null_count() == 0
        && (largest(column.keys().values()).is_none_or(within) || column.keys().iter().flatten().all(within));
    if good { Ok(()) } else { Err(Refused::Unreadable("a dictionary key without a value".into())) }
}

/// The largest key, a negative one counting as the largest of all.
fn largest(keys: &[i32]) -> Option<i32> {
    keys.iter().map(|key| key.cast_unsigned()).max().map(u32::cast_signed)
}
