//! The Parquet library on the same bytes, without the program. As the program builds it, the library does not check
//! checksums; our own header reader does.

use std::sync::{Arc, Mutex};

use arrow::array::ArrayRef;
use arrow::datatypes::{DataType, Fields};
use bytes::Bytes;
use bytes::buf::{Buf as _, Reader};
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, RowGroups};
use parquet::arrow::{ProjectionMask, parquet_to_arrow_field_levels, parquet_to_arrow_schema};
use parquet::column::page::{PageIterator, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

use super::mutate::{Mutant, START};
use super::thrift::Header;

/// The most bytes or values that the library is asked for. It allocates a page before decompressing it, and a
/// dictionary before reading its values.
const MOST: i64 = 1 << 22;

/// The refusal of a larger page.
pub const TOO_LARGE: &str = "larger than the reference is asked for";

/// The bytes, and the start of the header that was read last.
struct Stored(Bytes, Mutex<usize>);

impl Length for Stored {
    fn len(&self) -> u64 {
        START + self.0.len() as u64
    }
}

impl Stored {
    fn place(&self, start: u64) -> usize {
        usize::try_from(start.saturating_sub(START)).unwrap_or(usize::MAX).min(self.0.len())
    }
}

fn refused(words: &str) -> ParquetError {
    ParquetError::General(words.to_owned())
}

impl ChunkReader for Stored {
    type T = Reader<Bytes>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        let at = self.place(start);
        *self.1.lock().expect("one thread") = at;
        if Header::read(&self.0[at..]).is_some_and(|(header, _)| header.whole > MOST || header.get(1) > MOST) {
            return Err(refused(TOO_LARGE));
        }
        Ok(self.0.slice(at..).reader())
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let at = self.place(start);
        let end = at.checked_add(length).filter(|end| *end <= self.0.len()).ok_or_else(|| refused("the end"))?;
        let bytes = self.0.slice(at..end);
        let header = *self.1.lock().expect("one thread");
        let crc = Header::checksum(&self.0[header..]);
        // The library reads 32-bit integers and ignores the field's other bits.
        match crc.and_then(|crc| u32::try_from(crc & 0xffff_ffff).ok()) {
            Some(crc) if crc != crc32fast::hash(&bytes) => Err(refused("another checksum")),
            _ => Ok(bytes),
        }
    }
}

struct One<'a> {
    metadata: &'a ParquetMetaData,
    bytes: &'a Bytes,
}

struct Pages(Option<Result<Box<dyn PageReader>>>);

impl Iterator for Pages {
    type Item = Result<Box<dyn PageReader>>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.take()
    }
}

impl PageIterator for Pages {}

impl RowGroups for One<'_> {
    fn num_rows(&self) -> usize {
        usize::try_from(self.metadata.row_group(0).num_rows()).unwrap_or_default()
    }

    fn column_chunks(&self, column: usize) -> Result<Box<dyn PageIterator>> {
        let stored = Arc::new(Stored(self.bytes.clone(), Mutex::default()));
        let chunk = self.metadata.row_group(0).column(column);
        let reader = SerializedPageReader::new(stored, chunk, self.num_rows(), None);
        Ok(Box::new(Pages(Some(reader.map(|reader| Box::new(reader) as _)))))
    }

    fn row_groups(&self) -> Box<dyn Iterator<Item = &RowGroupMetaData> + '_> {
        Box::new(self.metadata.row_groups().iter())
    }

    fn metadata(&self) -> &ParquetMetaData {
        self.metadata
    }
}

/// The library's values of a mutant, in the types of the file, or its refusal as text.
pub fn read(mutant: &Mutant) -> Result<Vec<ArrayRef>, String> {
    read_as(mutant, None)
}

/// The same, with texts read as keys and their dictionary. For texts the library reads ahead of the last value.
pub fn read_keys(mutant: &Mutant) -> Result<Vec<ArrayRef>, String> {
    let keys = DataType::Dictionary(DataType::Int32.into(), DataType::Utf8.into());
    let schema = mutant.metadata.file_metadata().schema_descr();
    let schema = parquet_to_arrow_schema(schema, None).map_err(|error| error.to_string())?;
    read_as(
        mutant,
        Some(&schema.fields().iter().map(|field| field.as_ref().clone().with_data_type(keys.clone())).collect()),
    )
}

fn read_as(mutant: &Mutant, types: Option<&Fields>) -> Result<Vec<ArrayRef>, String> {
    let read = || -> Result<Vec<ArrayRef>> {
        let one = One { metadata: &mutant.metadata, bytes: &mutant.bytes };
        let schema = mutant.metadata.file_metadata().schema_descr();
        let levels = parquet_to_arrow_field_levels(schema, ProjectionMask::all(), types)?;
        let reader = ParquetRecordBatchReader::try_new_with_row_groups(&levels, &one, mutant.at_once, None)?;
        let mut columns = Vec::new();
        for batch in reader {
            columns.push(batch?.column(0).clone());
        }
        Ok(columns)
    };
    crate::quiet::contained(read).and_then(|read| read.map_err(|error| error.to_string()))
}
