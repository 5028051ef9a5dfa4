//! The bytes of a file, from the disk or from memory.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};

use bytes::Bytes;

/// Larger columns of a row group are read a page at a time, for the sake of memory.
const LARGEST: u64 = 8 << 20;

/// A file, or part of one in memory, addressed as the file is.
pub(in super::super) enum Store {
    File(File),
    Memory { start: u64, bytes: Bytes },
}

impl Store {
    /// A whole file in memory.
    pub(in super::super) fn memory(bytes: Bytes) -> Self {
        Self::Memory { start: 0, bytes }
    }

    /// The same, to be read by somebody else. Handles of one file share their position: one thread may have them.
    pub(in super::super) fn again(&self) -> io::Result<Self> {
        Ok(match self {
            Self::File(file) => Self::File(file.try_clone()?),
            Self::Memory { start, bytes } => Self::Memory { start: *start, bytes: bytes.clone() },
        })
    }

    /// A range of bytes, held in memory if it is small.
    pub(super) fn part(&self, start: u64, length: u64) -> io::Result<Self> {
        if length > LARGEST {
            return self.again();
        }
        let most = usize::try_from(length).unwrap_or(usize::MAX);
        Ok(Self::Memory { start, bytes: self.read(start, most)? })
    }

    /// `length` bytes from `start` on, or fewer where the end comes before.
    pub(super) fn read(&self, start: u64, length: usize) -> io::Result<Bytes> {
        match self {
            Self::File(file) => {
                let mut file = file;
                let mut bytes = Vec::new();
                file.seek(SeekFrom::Start(start))?;
                file.take(length as u64).read_to_end(&mut bytes)?;
                Ok(bytes.into())
            }
            Self::Memory { start: first, bytes } => {
                let from = start.checked_sub(*first).and_then(|from| usize::try_from(from).ok());
                let from = from.map_or(bytes.len(), |from| from.min(bytes.len()));
                Ok(bytes.slice(from..from.saturating_add(length).min(bytes.len())))
            }
        }
    }
}
