//! Batches of rows in a temporary file, between the two passes. Memory holds where each lies, not the rows.

use std::fs::File;
use std::io::{self, BufReader, Seek as _, SeekFrom, Write as _};
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::error::ArrowError;
use arrow::ipc::reader::StreamReader;
use arrow::ipc::writer::StreamWriter;

#[derive(Debug)]
pub(super) struct Spool {
    file: File,
    pub(super) batches: Vec<Batch>,
}

/// The place of a batch in the file, and of its rows in the source.
#[derive(Debug)]
pub(super) struct Batch {
    offset: u64,
    pub(super) lines: Lines,
    /// The file of the lines, if it is another one beside the source.
    pub(super) beside: Option<Arc<str>>,
}

/// The line of each row, from 1; blank lines count.
#[derive(Debug)]
pub(super) enum Lines {
    From(u64),
    Each(Vec<u64>),
}

impl Lines {
    /// The shortest form of these lines.
    pub(super) fn of(lines: Vec<u64>) -> Self {
        let is_dense = lines.windows(2).all(|pair| pair[0] + 1 == pair[1]);
        if is_dense { Self::From(lines.first().copied().unwrap_or(1)) } else { Self::Each(lines) }
    }

    pub(super) fn at(&self, row: usize) -> u64 {
        match self {
            Self::From(first) => first + row as u64,
            Self::Each(lines) => lines.get(row).copied().unwrap_or_default(),
        }
    }
}

impl Spool {
    pub(super) fn new() -> io::Result<Self> {
        Ok(Self { file: tempfile::tempfile()?, batches: Vec::new() })
    }

    pub(super) fn add(&mut self, rows: &RecordBatch, lines: Lines, beside: Option<Arc<str>>) -> Result<(), ArrowError> {
        let offset = self.file.seek(SeekFrom::End(0))?;
        let mut writer = StreamWriter::try_new_buffered(&self.file, rows.schema_ref())?;
        writer.write(rows)?;
        writer.into_inner()?.flush()?;
        self.batches.push(Batch { offset, lines, beside });
        Ok(())
    }

    pub(super) fn read(&self, batch: usize) -> Result<RecordBatch, ArrowError> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(self.batches[batch].offset))?;
        let mut reader = StreamReader::try_new(BufReader::new(file), None)?;
        reader.next().unwrap_or_else(|| {
            Err(ArrowError::IoError("the temporary file is cut off".into(), io::ErrorKind::UnexpectedEof.into()))
        })
    }
}
