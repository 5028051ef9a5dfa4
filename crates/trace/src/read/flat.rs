//! Rows of a Parquet file that is not a trace, verified and within the budgets like pages of traces.

use std::fs::File;
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::datatypes::{DataType, FieldRef, Fields};
use arrow::error::ArrowError;
use parquet::arrow::arrow_reader::ParquetRecordBatchReader;
use parquet::arrow::{ProjectionMask, parquet_to_arrow_schema};
use parquet::file::metadata::ParquetMetaData;

use super::budget::MOST_COLUMNS;
use super::footer::trace_file::is_nested;
use super::footer::{bounds, plain};
use super::verify::damaged;
use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use parquet_pages::checksums::ChunkChecksums;
use parquet_pages::{Expansion, FaultSlot, Library, Store, text_type};

const BATCH_ROWS: usize = 1024;

/// An open file that may be a table.
pub type TableFile = File;

/// Rows of a file without nested columns.
pub struct FlatRows(TableRows);

/// Rows of some columns of a file.
pub(crate) struct TableRows {
    file: String,
    reader: ParquetRecordBatchReader,
    slot: FaultSlot,
}

impl FlatRows {
    pub fn new(file: TableFile, metadata: Arc<ParquetMetaData>) -> Result<Self, String> {
        let columns = metadata.file_metadata().schema_descr().columns();
        if let Some(nested) = columns.iter().find(|column| column.path().parts().len() > 1) {
            return Err(words(&is_nested("", &nested.path().parts()[0])));
        }
        // The caller has verified all checksums of such a file before.
        let rows = TableRows::open("", file, metadata, ChunkChecksums::default(), None);
        rows.map(Self).map_err(|finding| words(&finding))
    }
}

impl TableRows {
    /// The rows of these columns, by their positions; of all columns if `None`.
    pub(crate) fn open(
        name: &str,
        file: TableFile,
        metadata: Arc<ParquetMetaData>,
        checksums: ChunkChecksums,
        roots: Option<&[usize]>,
    ) -> Result<Self, Box<Finding>> {
        let bytes = file.metadata().map_err(|error| Finding::unreadable(name, &error))?.len();
        let schema = metadata.file_metadata().schema_descr_ptr();
        MOST_COLUMNS.check(schema.num_columns() as u64).map_err(|exceeded| Finding::over_budget(name, &exceeded))?;
        if let Some(fault) = bounds::fault(name, bytes, &metadata).filter(|fault| fault.code != Code::NoEpisodes) {
            return Err(Box::new(fault));
        }
        let slot = FaultSlot::default();
        let damaged = |words: String| Box::new(damaged(name, &slot, &words));
        let fields = contained(|| parquet_to_arrow_schema(&schema, None)).map_err(damaged)?;
        let fields: Fields = fields.map_err(|error| damaged(plain(&error)))?.fields().iter().map(with_keys).collect();
        let row_groups = (0..metadata.num_row_groups()).collect();
        let store = Store::new(file, Arc::new(Expansion::new(bytes)));
        let library = Library { store, metadata, checksums, row_groups, slot: Arc::clone(&slot), writes_out: true };
        let mask =
            roots.map_or_else(ProjectionMask::all, |roots| ProjectionMask::roots(&schema, roots.iter().copied()));
        let reader = contained(|| library.reader(mask, Some(&fields), BATCH_ROWS, None)).map_err(damaged)?;
        let reader = reader.map_err(|error| damaged(plain(&error)))?;
        Ok(Self { file: name.to_owned(), reader, slot })
    }
}

/// Texts inside of nested columns as keys into a dictionary: the pages of nested columns are not checked for texts that
/// are written out.
fn with_keys(field: &FieldRef) -> FieldRef {
    let keyed = match field.data_type() {
        DataType::Struct(parts) => DataType::Struct(parts.iter().map(keyed).collect()),
        DataType::List(item) => DataType::List(keyed(item)),
        DataType::Map(entries, is_sorted) => DataType::Map(with_keys(entries), *is_sorted),
        _ => return Arc::clone(field),
    };
    Arc::new(field.as_ref().clone().with_data_type(keyed))
}

fn keyed(part: &FieldRef) -> FieldRef {
    match part.data_type() {
        DataType::Utf8 => Arc::new(part.as_ref().clone().with_data_type(text_type())),
        _ => with_keys(part),
    }
}

impl Iterator for FlatRows {
    type Item = Result<RecordBatch, String>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next().map(|batch| batch.map_err(|finding| words(&finding)))
    }
}

impl Iterator for TableRows {
    type Item = Result<RecordBatch, Box<Finding>>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch =
            contained(|| self.reader.next()).unwrap_or_else(|panic| Some(Err(ArrowError::ParquetError(panic))))?;
        Some(batch.map_err(|error| Box::new(damaged(&self.file, &self.slot, &error.to_string()))))
    }
}

fn words(finding: &Finding) -> String {
    let column = finding.column.as_ref().map_or_else(String::new, |column| format!("column `{column}`: "));
    format!("{column}expected {}, found {}; {}", finding.expected, finding.found, finding.help)
}
