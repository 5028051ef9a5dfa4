//! Rows of a flat Parquet file that is not a trace, verified and within the budgets like pages of traces.

use std::fs::File;
use std::sync::Arc;

use arrow::array::RecordBatch;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::ParquetRecordBatchReader;
use parquet::file::metadata::ParquetMetaData;

use super::budget::MOST_COLUMNS;
use super::footer::trace_file::is_nested;
use super::footer::{bounds, plain};
use super::verify::damaged;
use crate::diagnostic::{Code, Finding};
use parquet_pages::checksums::ChunkChecksums;
use parquet_pages::{Expansion, FaultSlot, Library, Store};

const BATCH_ROWS: usize = 1024;

/// An open file that may be a table.
pub type TableFile = File;

pub struct FlatRows {
    reader: ParquetRecordBatchReader,
    slot: FaultSlot,
}

impl FlatRows {
    pub fn new(file: TableFile, metadata: Arc<ParquetMetaData>) -> Result<Self, String> {
        let bytes = file.metadata().map_err(|error| error.to_string())?.len();
        let columns = metadata.file_metadata().schema_descr().columns();
        MOST_COLUMNS.check(columns.len() as u64).map_err(|exceeded| exceeded.to_string())?;
        if let Some(nested) = columns.iter().find(|column| column.path().parts().len() > 1) {
            return Err(words(&is_nested("", &nested.path().parts()[0])));
        }
        match bounds::fault("", bytes, &metadata) {
            Some(fault) if fault.code != Code::NoEpisodes => return Err(words(&fault)),
            _ => {}
        }
        let (row_groups, slot) = ((0..metadata.num_row_groups()).collect(), FaultSlot::default());
        let store = Store::new(file, Arc::new(Expansion::new(bytes)));
        // The caller has verified all checksums of such a file before.
        let checksums = ChunkChecksums::default();
        let library = Library { store, metadata, checksums, row_groups, slot: Arc::clone(&slot), writes_out: true };
        let reader = library.reader(ProjectionMask::all(), None, BATCH_ROWS, None);
        let reader = reader.map_err(|error| words(&damaged("", &slot, &plain(&error))))?;
        Ok(Self { reader, slot })
    }
}

impl Iterator for FlatRows {
    type Item = Result<RecordBatch, String>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = self.reader.next()?;
        Some(batch.map_err(|error| words(&damaged("", &self.slot, &error.to_string()))))
    }
}

fn words(finding: &Finding) -> String {
    let column = finding.column.as_ref().map_or_else(String::new, |column| format!("column `{column}`: "));
    format!("{column}expected {}, found {}; {}", finding.expected, finding.found, finding.help)
}
