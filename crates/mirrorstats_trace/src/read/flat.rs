//! The rows of a Parquet file as the file stores them, verified and within the budgets.

use std::fs::File;
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::datatypes::{DataType, FieldRef, Fields};
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, RowSelection};
use parquet::arrow::{ProjectionMask, parquet_to_arrow_schema};
use parquet::file::metadata::ParquetMetaData;

use super::budget::MOST_COLUMNS;
use super::footer::trace_file::is_nested;
use super::footer::{bounds, plain};
use super::verify::damaged;
use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use mirrorstats_parquet_pages::checksums::ChunkChecksums;
use mirrorstats_parquet_pages::{Expansion, FaultSlot, Library, Store, text_type};

/// Rows of a batch. Each batch has a cost of its own, which counts only where rows are narrow.
const WIDE_BATCH: usize = 1024;
const NARROW_BATCH: usize = 4096;
/// The stored bytes of a row from which it is wide.
const WIDE: u64 = 1024;

pub type TableFile = File;

/// Rows from the library's reader. A panic or an error of the library is a finding of the file.
pub struct CheckedRows {
    file: String,
    reader: ParquetRecordBatchReader,
    slot: FaultSlot,
}

impl CheckedRows {
    pub(crate) fn open(
        file: &str,
        library: &Library,
        columns: ProjectionMask,
        fields: &Fields,
        batch: usize,
        selection: Option<RowSelection>,
    ) -> Result<Self, Box<Finding>> {
        let slot = Arc::clone(&library.slot);
        let made = contained(|| library.reader(columns, Some(fields), batch, selection));
        match made.and_then(|reader| reader.map_err(|error| plain(&error))) {
            Ok(reader) => Ok(Self { file: file.to_owned(), reader, slot }),
            Err(error) => Err(Box::new(damaged(file, &slot, &error))),
        }
    }
}

impl Iterator for CheckedRows {
    type Item = Result<RecordBatch, Box<Finding>>;

    fn next(&mut self) -> Option<Self::Item> {
        let next =
            contained(|| self.reader.next()).and_then(|next| next.transpose().map_err(|error| error.to_string()));
        next.map_err(|error| Box::new(damaged(&self.file, &self.slot, &error))).transpose()
    }
}

/// The rows of a file without nested columns, whose checksums the caller has verified.
pub fn flat_rows(
    file: TableFile,
    metadata: Arc<ParquetMetaData>,
) -> Result<impl Iterator<Item = Result<RecordBatch, String>>, String> {
    check_flat("", &metadata).map_err(|finding| words(&finding))?;
    let rows = table_rows("", file, metadata, ChunkChecksums::default(), None).map_err(|finding| words(&finding))?;
    Ok(rows.map(|batch| batch.map_err(|finding| words(&finding))))
}

pub(crate) fn check_flat(name: &str, metadata: &ParquetMetaData) -> Result<(), Box<Finding>> {
    let columns = metadata.file_metadata().schema_descr().columns();
    let nested = columns.iter().map(|column| column.path().parts()).find(|parts| parts.len() > 1);
    nested.map_or(Ok(()), |parts| Err(Box::new(is_nested(name, &parts[0]))))
}

/// The rows of these columns of a file, by their positions; of all columns if `None`.
pub fn table_rows(
    name: &str,
    file: TableFile,
    metadata: Arc<ParquetMetaData>,
    checksums: ChunkChecksums,
    roots: Option<&[usize]>,
) -> Result<CheckedRows, Box<Finding>> {
    let row_groups = (0..metadata.num_row_groups()).collect();
    rows_of_part(name, file, metadata, checksums, roots, row_groups, None)
}

pub(crate) fn rows_of_part(
    name: &str,
    file: TableFile,
    metadata: Arc<ParquetMetaData>,
    checksums: ChunkChecksums,
    roots: Option<&[usize]>,
    row_groups: Vec<usize>,
    selection: Option<RowSelection>,
) -> Result<CheckedRows, Box<Finding>> {
    let bytes = file.metadata().map_err(|error| Finding::unreadable(name, &error))?.len();
    let schema = metadata.file_metadata().schema_descr_ptr();
    MOST_COLUMNS.check(schema.num_columns() as u64).map_err(|exceeded| Finding::over_budget(name, &exceeded))?;
    if let Some(fault) = bounds::fault(name, bytes, &metadata).filter(|fault| fault.code != Code::NoEpisodes) {
        return Err(Box::new(fault));
    }
    let slot = FaultSlot::default();
    let fields = contained(|| parquet_to_arrow_schema(&schema, None))
        .and_then(|fields| fields.map_err(|error| plain(&error)))
        .map_err(|error| damaged(name, &slot, &error))?;
    let fields: Fields = fields.fields().iter().map(with_keys).collect();
    let store = Store::new(file, Arc::new(Expansion::new(bytes)));
    let stored: u64 = metadata.row_groups().iter().map(|group| group.total_byte_size().unsigned_abs()).sum();
    let rows = metadata.file_metadata().num_rows().unsigned_abs().max(1);
    let batch = if stored / rows < WIDE { NARROW_BATCH } else { WIDE_BATCH };
    let library = Library { store, metadata, checksums, row_groups, slot, writes_out: true };
    let mask = roots.map_or_else(ProjectionMask::all, |roots| ProjectionMask::roots(&schema, roots.iter().copied()));
    CheckedRows::open(name, &library, mask, &fields, batch, selection)
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

fn words(finding: &Finding) -> String {
    let column = finding.column.as_ref().map_or_else(String::new, |column| format!("column `{column}`: "));
    format!("{column}expected {}, found {}; {}", finding.expected, finding.found, finding.help)
}
