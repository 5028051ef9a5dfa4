//! The bytes of a file, from the disk or from memory, and the location of a column's bytes.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::sync::Arc;

use bytes::Bytes;
use parquet::file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData};

use crate::checksums::{self, ChunkChecksums};
use crate::expansion::Expansion;

#[derive(Clone, Copy)]
pub struct Place<'a> {
    pub metadata: &'a ParquetMetaData,
    pub checksums: &'a ChunkChecksums,
    pub row_group: usize,
    /// The index of the column among the leaves of the schema.
    pub column: usize,
}

impl<'a> Place<'a> {
    pub(crate) fn chunk(self) -> &'a ColumnChunkMetaData {
        self.metadata.row_group(self.row_group).column(self.column)
    }

    pub(crate) fn rows(self) -> usize {
        rows_of(self.metadata.row_group(self.row_group))
    }
}

/// Larger columns of a row group are read page by page to save memory.
const LARGEST: u64 = 8 << 20;

/// A file, or a part of one in memory, addressed by file offsets.
pub struct Store {
    held: Backing,
    pub(crate) expansion: Arc<Expansion>,
}

enum Backing {
    File(File),
    Memory { start: u64, bytes: Bytes },
}

impl Store {
    pub fn new(file: File, expansion: Arc<Expansion>) -> Self {
        Self { held: Backing::File(file), expansion }
    }

    /// Bytes from `start` of a file that has not been expanded yet.
    pub fn of_memory(start: u64, bytes: Bytes) -> Self {
        let expansion = Arc::new(Expansion::new(bytes.len() as u64));
        Self { held: Backing::Memory { start, bytes }, expansion }
    }

    fn of(&self, held: Backing) -> Self {
        Self { held, expansion: Arc::clone(&self.expansion) }
    }

    pub(crate) fn again(&self) -> io::Result<Self> {
        Ok(self.of(match &self.held {
            Backing::File(file) => Backing::File(file.try_clone()?),
            Backing::Memory { start, bytes } => Backing::Memory { start: *start, bytes: bytes.clone() },
        }))
    }

    pub(crate) fn part(&self, start: u64, length: u64) -> io::Result<Self> {
        if length > LARGEST {
            return self.again();
        }
        let most = usize::try_from(length).unwrap_or(usize::MAX);
        Ok(self.of(Backing::Memory { start, bytes: self.read(start, most)? }))
    }

    /// The CRC-32 of `length` bytes from `start` on, or fewer at the end.
    pub(crate) fn sum(&self, start: u64, length: u64) -> io::Result<u32> {
        match &self.held {
            Backing::File(file) => {
                checksums::sum(file, start, length).map_err(|fault| io::Error::other(fault.to_string()))
            }
            Backing::Memory { .. } => {
                self.read(start, usize::try_from(length).unwrap_or(usize::MAX)).map(|bytes| crc32fast::hash(&bytes))
            }
        }
    }

    pub(crate) fn read(&self, start: u64, length: usize) -> io::Result<Bytes> {
        match &self.held {
            Backing::File(file) => {
                let mut file = file;
                // All in one call; if a footer claims more than this, the buffer grows while reading.
                let most = usize::try_from(LARGEST).unwrap_or(usize::MAX);
                let mut bytes = Vec::with_capacity(length.min(most));
                file.seek(SeekFrom::Start(start))?;
                file.take(length as u64).read_to_end(&mut bytes)?;
                Ok(bytes.into())
            }
            Backing::Memory { start: first, bytes } => {
                let from = start.checked_sub(*first).and_then(|from| usize::try_from(from).ok());
                let from = from.map_or(bytes.len(), |from| from.min(bytes.len()));
                Ok(bytes.slice(from..from.saturating_add(length).min(bytes.len())))
            }
        }
    }
}

/// The number of rows of a row group; opening has refused invalid numbers.
pub fn rows_of(row_group: &RowGroupMetaData) -> usize {
    usize::try_from(row_group.num_rows()).unwrap_or_default()
}
