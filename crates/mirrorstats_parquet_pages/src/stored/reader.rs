//! The decompressed pages of a column, for decoders.

use std::sync::Arc;

use parquet::basic::Compression;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::Result;
use parquet::file::serialized_reader::SerializedPageReader;

use super::bytes::{Place, Store};
use super::verified::Verified;
use crate::decode::contents::Contents;
use crate::error::FaultSlot;

pub(crate) struct Pages {
    stored: Arc<Verified>,
    inner: SerializedPageReader<Verified>,
    next: Option<Page>,
    contents: Option<Contents>,
}

impl Pages {
    pub(crate) fn new(store: &Store, place: Place<'_>, slot: FaultSlot) -> Result<Self> {
        let stored = Arc::new(Verified::new(store, place, slot)?);
        let inner = match place.chunk().compression() {
            // They are decompressed already.
            Compression::ZSTD(_) => {
                let chunk = place.chunk().clone().into_builder().set_compression(Compression::UNCOMPRESSED).build()?;
                SerializedPageReader::new(Arc::clone(&stored), &chunk, place.rows(), None)?
            }
            _ => SerializedPageReader::new(Arc::clone(&stored), place.chunk(), place.rows(), None)?,
        };
        Ok(Self { stored, inner, next: None, contents: None })
    }

    /// The same for a decoder that does not check contents.
    pub(crate) fn checked(store: &Store, place: Place<'_>, slot: FaultSlot, writes_out: bool) -> Result<Self> {
        let about = place.chunk().column_descr();
        let flat = about.max_rep_level() == 0 && about.max_def_level() <= 1;
        let contents = flat.then(|| Contents::new(about, writes_out));
        Ok(Self { contents, ..Self::new(store, place, slot)? })
    }

    fn load(&mut self) -> Result<Option<Page>> {
        let Some(page) = self.inner.get_next_page()? else {
            return self.stored.finish().map(|()| None);
        };
        match self.contents.as_mut().map_or(Ok(0), |contents| contents.check(&page)) {
            Ok(bytes) => self.stored.texts(bytes)?,
            Err((expected, found)) => return Err(self.stored.fault(self.stored.offset(), expected, found)),
        }
        Ok(Some(page))
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

/// Skipped pages are read and checked like the others.
impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        match self.next.take() {
            Some(page) => Ok(Some(page)),
            None => self.load(),
        }
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        if self.next.is_none() {
            self.next = self.load()?;
        }
        Ok(self.next.as_ref().map(|page| match page {
            Page::DictionaryPage { .. } => PageMetadata { num_rows: None, num_levels: None, is_dict: true },
            Page::DataPage { num_values, .. } => {
                PageMetadata { num_rows: None, num_levels: Some(*num_values as usize), is_dict: false }
            }
            Page::DataPageV2 { num_values, num_rows, .. } => PageMetadata {
                num_rows: Some(*num_rows as usize),
                num_levels: Some(*num_values as usize),
                is_dict: false,
            },
        }))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.get_next_page().map(drop)
    }
}
