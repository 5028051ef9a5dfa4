//! One column of pages in memory, read by the decoders of a scan, without a file or an encoded footer.
//!
//! A scan takes rows from the short cut until that gives up, and the rest from the library. A target tests the two
//! separately, because each must agree with another reader of the same bytes.

use std::sync::Arc;

use arrow::array::ArrayRef;
use arrow::datatypes::DataType;
use bytes::Bytes;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, RowSelection, RowSelector};
use parquet::arrow::parquet_to_arrow_schema;
use parquet::basic::ConvertedType;
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;

use mirrorstats_parquet_pages::checksums::ChunkChecksums;
use mirrorstats_parquet_pages::{
    Column, Cursor, FaultSlot, Form, Library, Place, Refused, Store, normal_column, rows_of, text_type, verify,
    with_texts_as_keys,
};

use crate::quiet::contained;

/// Row group 0 of a file with one column.
pub struct OneColumn {
    footer: ArrowReaderMetadata,
    held: DataType,
    start: u64,
    bytes: Bytes,
}

/// The refusal of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The expected value; `None` if the Parquet library found the fault.
    pub expected: Option<String>,
    /// The value found, or the library's message.
    pub found: String,
}

impl Refusal {
    fn library(found: String) -> Self {
        Self { expected: None, found }
    }
}

impl OneColumn {
    /// The column of a file with this footer; `bytes` start at offset `start` of the file.
    pub fn new(metadata: ParquetMetaData, start: u64, bytes: Bytes) -> Result<Self, Refusal> {
        let schema = metadata.file_metadata().schema_descr();
        let plain = |error: ParquetError| Refusal::library(error.to_string());
        let fields = contained(|| parquet_to_arrow_schema(schema, None)).map_err(Refusal::library)?.map_err(plain)?;
        let is_text = schema.column(0).converted_type() == ConvertedType::UTF8;
        let held = fields.fields().first().map_or(DataType::Null, |field| held_as(field.data_type(), is_text));
        let texts = [held == text_type()];
        let footer = contained(|| with_texts_as_keys(metadata, &texts)).map_err(Refusal::library)?.map_err(plain)?;
        Ok(Self { footer, held, start, bytes })
    }

    fn store(&self) -> Store {
        Store::of_memory(self.start, self.bytes.clone())
    }

    /// The short cut's rows, `at_once` at a time until it gives up, and true if it reached the end.
    pub fn short_cut(&self, runs: bool, at_once: usize) -> Result<(Vec<ArrayRef>, bool), String> {
        let form = if runs { Form::Runs } else { Form::Rows };
        contained(|| {
            let metadata = self.footer.metadata();
            let checksums = &ChunkChecksums::default();
            let place = Place { metadata, checksums, row_group: 0, column: 0 };
            let stored = self.footer.schema().field(0).data_type();
            let mut rows = Vec::new();
            let Ok(mut cursor) = Cursor::open(&self.store(), place, stored, form) else { return (rows, false) };
            let mut left = rows_of(metadata.row_group(0));
            while left > 0 {
                let count = left.min(at_once.max(1));
                let Some(read) = cursor.read(count).ok().and_then(|column: Column| column.flat().ok()) else {
                    return (rows, false);
                };
                rows.push(read);
                left -= count;
            }
            let is_whole = cursor.read(0).is_ok();
            (rows, is_whole)
        })
    }

    /// The library's rows of checked pages, starting at row `first`, `at_once` at a time.
    pub fn checked(&self, first: usize, at_once: usize) -> Result<Vec<ArrayRef>, Refusal> {
        let slot = FaultSlot::default();
        let refused = |found: String| match slot.get() {
            Some(fault) => Refusal { expected: Some(fault.expected.clone()), found: fault.found.clone() },
            None => Refusal::library(found),
        };
        let metadata = Arc::clone(self.footer.metadata());
        let rows = rows_of(metadata.row_group(0));
        let (store, checksums, kept) = (self.store(), ChunkChecksums::default(), Arc::clone(&slot));
        let library = Library { store, metadata, checksums, row_groups: vec![0], slot: kept, writes_out: false };
        let rest = vec![RowSelector::skip(first), RowSelector::select(rows.saturating_sub(first))];
        let selection = (first > 0).then(|| RowSelection::from(rest));
        let fields = Some(self.footer.schema().fields());
        let reader = contained(|| library.reader(ProjectionMask::all(), fields, at_once.max(1), selection))
            .map_err(refused)?
            .map_err(|error| refused(error.to_string()))?;
        let mut reader = reader;
        let mut columns = Vec::new();
        while let Some(batch) = contained(|| reader.next()).map_err(refused)? {
            let batch = batch.map_err(|error| refused(error.to_string()))?;
            let column = contained(|| normal_column(batch.column(0), &self.held)).map_err(refused)?;
            columns.push(column.map_err(|refused| match refused {
                Refused::Unreadable(why) => Refusal::library(why),
                Refused::TooLarge { value, .. } => {
                    Refusal { expected: Some(format!("a number up to {}", i64::MAX)), found: value.to_string() }
                }
            })?);
        }
        let found: usize = columns.iter().map(|column| column.len()).sum();
        if found != rows - first.min(rows) {
            return Err(Refusal::library(format!("{found} rows, not {}", rows - first.min(rows))));
        }
        Ok(columns)
    }

    /// Checks headers and checksums, as `validate` does for columns that it does not decode.
    pub fn verified(&self) -> Result<(), Refusal> {
        let (slot, metadata) = (FaultSlot::default(), self.footer.metadata());
        let checksums = &ChunkChecksums::default();
        let place = Place { metadata, checksums, row_group: 0, column: 0 };
        verify(&self.store(), place, &slot).map_err(|error| match slot.get() {
            Some(fault) => Refusal { expected: Some(fault.expected.clone()), found: fault.found.clone() },
            None => Refusal::library(error.to_string()),
        })
    }
}

fn held_as(stored: &DataType, is_text: bool) -> DataType {
    match stored {
        DataType::Boolean => DataType::Boolean,
        integer if integer.is_integer() => DataType::Int64,
        float if float.is_floating() => DataType::Float64,
        DataType::Utf8 if is_text => text_type(),
        _ => DataType::Null,
    }
}
