//! The bytes of one column of one row group, read at once.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::sync::Arc;

use bytes::Bytes;
use bytes::buf::{Buf as _, Reader};
use parquet::column::page::PageReader;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::{ChunkReader, Length};
use parquet::file::serialized_reader::SerializedPageReader;

use super::Unfit;

/// Larger ones are read a page at a time, for the sake of memory.
const LARGEST: u64 = 8 << 20;

/// Part of a file in memory, addressed as the file is.
struct Chunk {
    start: u64,
    bytes: Bytes,
}

impl Length for Chunk {
    fn len(&self) -> u64 {
        self.start + self.bytes.len() as u64
    }
}

impl ChunkReader for Chunk {
    type T = Reader<Bytes>;

    fn get_read(&self, start: u64) -> Result<Self::T> {
        let from = self.place(start)?;
        Ok(self.bytes.slice(from..).reader())
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let from = self.place(start)?;
        let to = from.checked_add(length).filter(|to| *to <= self.bytes.len());
        to.map(|to| self.bytes.slice(from..to)).ok_or_else(outside)
    }
}

impl Chunk {
    fn place(&self, start: u64) -> Result<usize> {
        let from = start.checked_sub(self.start).and_then(|from| usize::try_from(from).ok());
        from.filter(|from| *from <= self.bytes.len()).ok_or_else(outside)
    }
}

fn outside() -> ParquetError {
    ParquetError::EOF("a page lies outside of its column".into())
}

/// The pages of a column.
pub(super) fn pages(
    file: &File,
    column: &ColumnChunkMetaData,
    rows: usize,
) -> std::result::Result<Box<dyn PageReader>, Unfit> {
    let (start, length) = column.byte_range();
    let handle = file.try_clone().map_err(|_| Unfit)?;
    if length > LARGEST {
        return Ok(Box::new(SerializedPageReader::new(Arc::new(handle), column, rows, None).map_err(|_| Unfit)?));
    }
    let bytes = read(handle, start, length).map_err(|_| Unfit)?;
    let chunk = Arc::new(Chunk { start, bytes });
    Ok(Box::new(SerializedPageReader::new(chunk, column, rows, None).map_err(|_| Unfit)?))
}

fn read(mut file: File, start: u64, length: u64) -> std::io::Result<Bytes> {
    let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or_default());
    file.seek(SeekFrom::Start(start))?;
    file.take(length).read_to_end(&mut bytes)?;
    Ok(bytes.into())
}
