//! The stored pages of one column of one row group, verified while they are read.
//!
//! Rule: all decoders of trace pages read their bytes here. So no header that contradicts the footer is decoded, and no
//! page or chunk that contradicts its checksum. A chunk is summed before its first page is returned, since a reader may
//! stop early. A chunk that is too large for memory is read twice for that.

use std::fmt;
use std::io;
use std::sync::{Mutex, PoisonError};

use bytes::Bytes;
use bytes::buf::{Buf as _, Reader};
use parquet::errors::{ParquetError, Result};
use parquet::file::reader::{ChunkReader, Length};

use super::bytes::{Place, Store};
use super::header::{About, Header, Kind};
use super::zstd;
use crate::error::{FaultKind, FaultSlot, PageFault, Part};
use crate::thrift;
use mirrorstats_exact::budget::Exceeded;

/// The number of bytes read to find a header; most headers are shorter than 100 bytes.
const HEADER: usize = 1 << 10;
/// The longest header: texts among its statistics may be long.
const LONGEST_HEADER: usize = 16 << 20;

pub(crate) struct Verified {
    store: Store,
    place: (usize, usize),
    column: String,
    start: u64,
    end: u64,
    about: About,
    /// True if the column has one value per row, null or not.
    flat: bool,
    progress: Mutex<Progress>,
    slot: FaultSlot,
}

#[derive(Default)]
struct Progress {
    page: Option<(u64, Header)>,
    /// The number of pages before it, and their values.
    pages: usize,
    values: usize,
}

impl Verified {
    pub(crate) fn new(store: &Store, place: Place<'_>, slot: FaultSlot) -> Result<Self> {
        let column = place.chunk();
        let (start, length) = column.byte_range();
        let described = column.column_descr();
        let about = About {
            codec: column.compression(),
            physical: described.physical_type(),
            width: usize::try_from(described.type_length()).unwrap_or_default(),
            optional: described.max_def_level() > 0,
            rows: place.rows(),
        };
        let flat = described.max_rep_level() == 0 && described.path().parts().len() == 1;
        let unreadable = |error: io::Error| ParquetError::External(Box::new(error));
        let pages = Self {
            store: store.part(start, length).map_err(unreadable)?,
            place: (place.row_group, place.column),
            column: column.column_path().string(),
            start,
            end: start.saturating_add(length),
            about,
            flat,
            progress: Mutex::default(),
            slot,
        };
        let declared = place.checksums.of(place.row_group, place.column);
        let sums = declared.map(|declared| pages.store.sum(start, length).map(|found| (declared, found)));
        match sums.transpose().map_err(unreadable)? {
            Some((declared, found)) if declared != found => {
                let expected = format!("bytes with the CRC-32 {declared:08x}");
                Err(pages.keep(FaultKind::Corrupt, Part::Chunk(start, pages.end), expected, format!("{found:08x}")))
            }
            _ => Ok(pages),
        }
    }

    pub(crate) fn walk(&self) -> Result<()> {
        let mut at = self.start;
        while at < self.end {
            let header = self.enter(at)?.1;
            let body = at + header.length as u64;
            self.body(body, header.stored)?;
            at = body + header.stored as u64;
        }
        self.finish()
    }

    pub(crate) fn finish(&self) -> Result<()> {
        let values = self.progress.lock().unwrap_or_else(PoisonError::into_inner).values;
        if self.flat && values != self.about.rows {
            return Err(self.fault(self.start, format!("pages of {} values", self.about.rows), values));
        }
        Ok(())
    }

    pub(crate) fn offset(&self) -> u64 {
        self.progress.lock().unwrap_or_else(PoisonError::into_inner).page.as_ref().map_or(self.start, |page| page.0)
    }

    /// The error of a page at `offset`, kept for the caller that asked for the column.
    pub(crate) fn fault(&self, offset: u64, expected: impl Into<String>, found: impl fmt::Display) -> ParquetError {
        self.keep(FaultKind::Corrupt, Part::Page(offset), expected.into(), found.to_string())
    }

    fn over(&self, offset: u64, exceeded: &Exceeded) -> ParquetError {
        self.keep(FaultKind::OverBudget, Part::Page(offset), exceeded.expected(), "more".to_owned())
    }

    fn keep(&self, kind: FaultKind, part: Part, expected: String, found: String) -> ParquetError {
        let (row_group, column) = (self.place.0, self.column.clone());
        let fault = PageFault { kind, row_group, column, part, expected, found };
        let _ = self.slot.set(fault.clone());
        ParquetError::External(Box::new(fault))
    }

    pub(crate) fn texts(&self, bytes: u64) -> Result<()> {
        let offset = self.offset();
        self.store.expansion.texts(self.place, offset, bytes).map_err(|exceeded| self.over(offset, &exceeded))
    }

    /// The page that starts at `offset`: the bytes of its header, and the parsed header.
    fn enter(&self, offset: u64) -> Result<(Bytes, Header)> {
        let left = usize::try_from(self.end.saturating_sub(offset)).unwrap_or(usize::MAX);
        let (bytes, header) = self.header(offset, left)?;
        let mut progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        if header.stored > left - header.length {
            let expected = format!("a page of at most {} bytes", left - header.length);
            return Err(self.fault(offset, expected, header.stored));
        }
        if header.kind == Kind::Dictionary && progress.pages > 0 {
            return Err(self.fault(offset, "a dictionary before all other pages", "one behind them"));
        }
        if self.flat
            && let Some((expected, found)) = header.fault(&self.about, progress.values)
        {
            return Err(self.fault(offset, expected, found));
        }
        // A run of a few bytes may expand to millions of list items. The number of rows does not limit them.
        let items = if self.flat { 0 } else { header.values.saturating_mul(size_of::<u64>()) };
        let inflated = header.whole.max(items);
        self.store.expansion.page(self.place, offset, inflated).map_err(|exceeded| self.over(offset, &exceeded))?;
        progress.pages += 1;
        if matches!(header.kind, Kind::Data | Kind::DataV2) {
            progress.values += header.values;
        }
        progress.page = Some((offset, header.clone()));
        Ok((bytes.slice(..header.length), header))
    }

    fn header(&self, offset: u64, left: usize) -> Result<(Bytes, Header)> {
        let mut most = HEADER;
        loop {
            let bytes = self.store.read(offset, most.min(left)).map_err(|error| self.fault(offset, "a page", error))?;
            match Header::parse(&bytes) {
                Ok(header) => return Ok((bytes, header)),
                Err(thrift::ThriftFault::Ends) if bytes.len() == most && most < LONGEST_HEADER => most *= 8,
                Err(fault) => return Err(self.fault(offset, "a page header", fault)),
            }
        }
    }

    fn body(&self, start: u64, length: usize) -> Result<Bytes> {
        let progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        let page = progress
            .page
            .as_ref()
            .filter(|(offset, header)| start == offset + header.length as u64 && length == header.stored);
        let Some((offset, header)) = page else {
            return Err(self.fault(start, "a page header that has one meaning", "one that can be read in two ways"));
        };
        let bytes = self.store.read(start, length).map_err(|error| self.fault(*offset, "a page", error))?;
        if bytes.len() != length {
            return Err(self.fault(*offset, format!("a page of {length} bytes"), bytes.len()));
        }
        match header.checksum.map(|declared| (declared, crc32fast::hash(&bytes))) {
            Some((declared, computed)) if declared != computed => {
                let (expected, found) = (format!("bytes with the CRC-32 {declared:08x}"), format!("{computed:08x}"));
                Err(self.fault(*offset, expected, found))
            }
            _ => Ok(bytes),
        }
    }
}

impl Length for Verified {
    fn len(&self) -> u64 {
        self.end
    }
}

impl ChunkReader for Verified {
    type T = Reader<Bytes>;

    /// The header of the page at `start`, without the bytes after it.
    fn get_read(&self, start: u64) -> Result<Self::T> {
        self.enter(start).map(|(header, _)| header.reader())
    }

    /// The bytes of the current page, decompressed if [`zstd`] handles its codec.
    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let stored = self.body(start, length)?;
        let progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        match &progress.page {
            Some((offset, header)) if header.is_zstd(&self.about) => {
                zstd::inflated(&stored, header.levels, header.whole)
                    .map(Bytes::from)
                    .map_err(|found| self.fault(*offset, "a page that zstd decompresses to its size", found))
            }
            _ => Ok(stored),
        }
    }
}
