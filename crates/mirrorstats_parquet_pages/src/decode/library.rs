//! The Parquet library's row reader on verified pages.

use std::sync::Arc;

use arrow::datatypes::Fields;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, RowGroups, RowSelection};
use parquet::arrow::{ProjectionMask, parquet_to_arrow_field_levels};
use parquet::column::page::{PageIterator, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};

use crate::checksums::ChunkChecksums;
use crate::error::FaultSlot;
use crate::stored::bytes::{Place, Store, rows_of};
use crate::stored::reader::Pages;

pub struct Library {
    pub store: Store,
    pub metadata: Arc<ParquetMetaData>,
    pub checksums: ChunkChecksums,
    pub row_groups: Vec<usize>,
    pub slot: FaultSlot,
    /// True if texts are needed row by row, not as keys into a dictionary.
    pub writes_out: bool,
}

impl Library {
    pub fn reader(
        &self,
        columns: ProjectionMask,
        fields: Option<&Fields>,
        batch: usize,
        selection: Option<RowSelection>,
    ) -> Result<ParquetRecordBatchReader> {
        let schema = self.metadata.file_metadata().schema_descr();
        let levels = parquet_to_arrow_field_levels(schema, columns, fields)?;
        ParquetRecordBatchReader::try_new_with_row_groups(&levels, self, batch, selection)
    }
}

impl RowGroups for Library {
    fn num_rows(&self) -> usize {
        self.row_groups().map(rows_of).sum()
    }

    fn column_chunks(&self, column: usize) -> Result<Box<dyn PageIterator>> {
        let store = self.store.again().map_err(|error| ParquetError::External(Box::new(error)))?;
        let (metadata, checksums) = (Arc::clone(&self.metadata), self.checksums.clone());
        let (slot, writes_out) = (Arc::clone(&self.slot), self.writes_out);
        Ok(Box::new(Chunks(self.row_groups.clone().into_iter().map(move |row_group| {
            let place = Place { metadata: &metadata, checksums: &checksums, row_group, column };
            let pages = Pages::checked(&store, place, Arc::clone(&slot), writes_out)?;
            Ok(Box::new(pages) as Box<dyn PageReader>)
        }))))
    }

    fn row_groups(&self) -> Box<dyn Iterator<Item = &RowGroupMetaData> + '_> {
        Box::new(self.row_groups.iter().map(|at| self.metadata.row_group(*at)))
    }

    fn metadata(&self) -> &ParquetMetaData {
        &self.metadata
    }
}

struct Chunks<I>(I);

impl<I: Iterator> Iterator for Chunks<I> {
    type Item = I::Item;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.next()
    }
}

impl<I: Iterator<Item = Result<Box<dyn PageReader>>> + Send> PageIterator for Chunks<I> {}
