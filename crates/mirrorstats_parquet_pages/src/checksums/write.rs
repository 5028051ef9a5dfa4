use std::io::{self, Write};

use memchr::memmem;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::{KeyValue, RowGroupMetaData};
use parquet::file::writer::SerializedFileWriter;

use super::{ALGORITHM, CREATED_BY, Checksum, FIRST, KEY, Stated, digits, range};

/// The output of a Parquet writer for a file with checksums. Holds the bytes of a row group until it is closed and
/// summed, and those of the footer until its digits are known.
pub struct Held<W> {
    out: W,
    bytes: Vec<u8>,
    start: u64,
    end: u64,
    chunks: Vec<Vec<Checksum>>,
}

impl<W: Write> Held<W> {
    pub fn new(out: W) -> Self {
        Self { out, bytes: Vec::new(), start: 0, end: FIRST, chunks: Vec::new() }
    }

    pub fn row_groups(&self) -> usize {
        self.chunks.len()
    }

    /// Sums the row groups closed since the last call, and passes their bytes on.
    pub fn pass_on(&mut self, closed: &[RowGroupMetaData]) -> Result<()> {
        for group in closed {
            let sums = group.columns().iter().map(|chunk| {
                let (start, end) = range(chunk).ok_or_else(misplaced)?;
                self.end = self.end.max(end);
                self.bytes_of(start, end).map(|bytes| Checksum(crc32fast::hash(bytes))).ok_or_else(misplaced)
            });
            let sums = sums.collect::<Result<_>>()?;
            self.chunks.push(sums);
        }
        self.out.write_all(&self.bytes)?;
        self.start += self.bytes.len() as u64;
        self.bytes.clear();
        Ok(())
    }

    fn bytes_of(&self, start: u64, end: u64) -> Option<&[u8]> {
        let at = |place: u64| usize::try_from(place.checked_sub(self.start)?).ok();
        self.bytes.get(at(start)?..at(end)?)
    }

    pub fn release(mut self) -> Result<W> {
        self.out.write_all(&self.bytes)?;
        self.out.flush()?;
        Ok(self.out)
    }

    fn stated(&self) -> Stated {
        Stated {
            algorithm: ALGORITHM.to_owned(),
            created_by: CREATED_BY.to_owned(),
            chunks: self.chunks.clone(),
            footer: Checksum::default(),
        }
    }

    fn close(mut self, mut stated: Stated) -> Result<W> {
        let open = stated.json();
        let place = memmem::rfind(&self.bytes, open.as_bytes()).ok_or_else(misplaced)?;
        // The footer's length and the magic number follow the footer.
        let footer = self.bytes.len().checked_sub(8).map(|length| self.start + length as u64);
        let summed = footer.and_then(|footer| self.bytes_of(self.end, footer)).ok_or_else(misplaced)?;
        stated.footer = Checksum(crc32fast::hash(summed));
        let digits = digits(open.len());
        self.bytes[place..][digits.clone()].copy_from_slice(&stated.json().as_bytes()[digits]);
        self.release()
    }
}

impl<W: Write> Write for Held<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Sums the row groups of a file that were closed since the last call, and passes their bytes on.
pub fn pass_on<W: Write + Send>(file: &mut SerializedFileWriter<Held<W>>) -> Result<()> {
    file.flush()?;
    let closed = file.flushed_row_groups()[file.inner().row_groups()..].to_vec();
    file.inner_mut().pass_on(&closed)
}

/// Writes the footer of a file whose row groups are closed, with its checksums; its properties name [`CREATED_BY`].
pub fn finish<W: Write + Send>(mut file: SerializedFileWriter<Held<W>>) -> Result<W> {
    pass_on(&mut file)?;
    let stated = file.inner().stated();
    file.append_key_value_metadata(KeyValue::new(KEY.to_owned(), stated.json()));
    file.into_inner()?.close(stated)
}

fn misplaced() -> ParquetError {
    ParquetError::General("a part of the file does not lie where its footer says".to_owned())
}
