//! Checks a column's decompressed pages before the Parquet library decodes them.
//!
//! The library treats any level that is not 0 as 1, and ignores bytes after the last level. Rule: an accepted page has
//! a valid level for each row, as many values as its levels require, and keys within its dictionary. Bytes after the
//! values are ignored: fastparquet writes eight. Delta encodings are only checked for their number of values; the
//! library reads the blocks.

use bytes::Bytes;
use parquet::basic::{Encoding, Type as Physical};
use parquet::column::page::Page;
use parquet::schema::types::ColumnDescriptor;

use super::delta;
use super::rle::{Hybrid, Span, prefixed};
use crate::error::Unsupported;
use crate::stored::header::width;

/// The pages of one flat column of one row group, in order.
pub(crate) struct Contents {
    physical: Physical,
    width: usize,
    optional: bool,
    keys: Option<usize>,
    texts: Texts,
}

/// The size of the written-out texts of pages: dictionary keys that do not stay keys, and texts stored as differences
/// from the one before.
struct Texts {
    lengths: Vec<u32>,
    /// True if keys are written out; the library also does that to keys before a page without keys.
    writes_out: bool,
    behind_keys: u64,
    added: u64,
}

/// Texts of smaller dictionaries are short, so they are not counted while they stay keys.
const SMALL_DICTIONARY: usize = 64 << 10;

impl Texts {
    fn of_dictionary(&mut self, mut values: &[u8]) {
        if values.len() <= SMALL_DICTIONARY && !self.writes_out {
            return;
        }
        // `plain` has checked that they are there.
        while let Some((length, rest)) = values.split_first_chunk() {
            let length = u32::from_le_bytes(*length);
            self.lengths.push(length);
            values = rest.get(length as usize..).unwrap_or_default();
        }
    }

    fn key(&mut self, key: u32, count: usize) {
        if let Some(length) = self.lengths.get(key as usize) {
            self.behind_keys = self.behind_keys.saturating_add(u64::from(*length).saturating_mul(count as u64));
        }
    }

    fn take(&mut self) -> u64 {
        if self.writes_out {
            self.added = self.added.saturating_add(std::mem::take(&mut self.behind_keys));
        }
        std::mem::take(&mut self.added)
    }
}

/// The problem of a page: expected and found.
type ContentFault = (&'static str, String);

impl Contents {
    pub(crate) fn new(column: &ColumnDescriptor, writes_out: bool) -> Self {
        let declared = usize::try_from(column.type_length()).unwrap_or_default();
        let physical = column.physical_type();
        Self {
            physical,
            width: width(physical, declared),
            optional: column.max_def_level() > 0,
            keys: None,
            texts: Texts { lengths: Vec::new(), writes_out, behind_keys: 0, added: 0 },
        }
    }

    /// Returns the number of bytes of written-out texts that the page adds.
    pub(crate) fn check(&mut self, page: &Page) -> Result<u64, ContentFault> {
        self.check_page(page)?;
        Ok(self.texts.take())
    }

    fn check_page(&mut self, page: &Page) -> Result<(), ContentFault> {
        match page {
            Page::DictionaryPage { buf, num_values, .. } => {
                let count = *num_values as usize;
                self.keys = Some(count);
                self.plain(buf, count)?;
                if self.physical == Physical::BYTE_ARRAY {
                    self.texts.of_dictionary(buf);
                }
                Ok(())
            }
            Page::DataPage { buf, num_values, encoding, def_level_encoding, .. } => {
                let rows = (*num_values as usize, None);
                match (self.optional, def_level_encoding) {
                    (false, _) => self.data(rows, None, buf, *encoding),
                    (true, Encoding::RLE) => {
                        let (levels, values) = prefixed(buf).map_err(|Unsupported| levels("fewer bytes"))?;
                        self.data(rows, Some(levels), &values, *encoding)
                    }
                    // One bit per level is always 0 or 1.
                    (true, _) => Ok(()),
                }
            }
            Page::DataPageV2 {
                buf, num_values, encoding, num_nulls, def_levels_byte_len, rep_levels_byte_len, ..
            } => {
                let start = *rep_levels_byte_len as usize;
                let end = start + *def_levels_byte_len as usize;
                if end > buf.len() {
                    return Err(levels("fewer bytes"));
                }
                let rows = *num_values as usize;
                no_levels(buf.slice(..start), rows)?;
                let levels = buf.slice(start..end);
                if !self.optional {
                    no_levels(levels.clone(), rows)?;
                }
                let declared = (rows, Some(*num_nulls as usize));
                self.data(declared, self.optional.then_some(levels), &buf.slice(end..), *encoding)
            }
        }
    }

    /// Checks a data page of this number of rows, and of nulls if it is declared.
    fn data(
        &mut self,
        (rows, nulls): (usize, Option<usize>),
        stored: Option<Bytes>,
        values: &Bytes,
        encoding: Encoding,
    ) -> Result<(), ContentFault> {
        let count = match stored {
            Some(stored) => {
                ones(stored, rows).map_err(|Unsupported| levels("runs of another length, or levels above 1"))?
            }
            None => rows,
        };
        if let Some(nulls) = nulls.filter(|nulls| nulls + count != rows) {
            return Err(("as many nulls as its header says", format!("{}, not {nulls}", rows - count)));
        }
        if !matches!(encoding, Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY) {
            self.texts.writes_out = true;
        }
        match (encoding, self.physical) {
            (Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY, _) => self.dictionary(values, count),
            (Encoding::PLAIN, _) => self.plain(values, count),
            (Encoding::RLE, Physical::BOOLEAN) => {
                let truths = prefixed(values).and_then(|(truths, _)| Hybrid::new(truths, 1, count));
                let sound = truths.and_then(|mut truths| {
                    truths.each_span(count, |_| ())?;
                    truths.finish_values()
                });
                sound.map_err(|Unsupported| ("a truth value for each row", "runs of another length".into()))
            }
            // The position of a value's bytes depends on the number of values.
            (Encoding::BYTE_STREAM_SPLIT, _) if count.checked_mul(self.width) == Some(values.len()) => Ok(()),
            (Encoding::BYTE_STREAM_SPLIT, _) => Err(other_bytes(values, count, self.width)),
            (Encoding::DELTA_BYTE_ARRAY, _) => {
                delta(values, count)?;
                if count == 0 {
                    return Ok(());
                }
                let shared = delta::sum(values).map_err(|Unsupported| ("lengths from 0", "others".to_owned()))?;
                self.texts.added = self.texts.added.saturating_add(shared);
                Ok(())
            }
            (Encoding::DELTA_BINARY_PACKED | Encoding::DELTA_LENGTH_BYTE_ARRAY, _) => delta(values, count),
            _ => Ok(()),
        }
    }

    fn dictionary(&mut self, values: &Bytes, count: usize) -> Result<(), ContentFault> {
        let fault = |found: &str| ("keys within the dictionary, one for each value", found.to_owned());
        let keys = self.keys.ok_or_else(|| fault("no dictionary"))?;
        if values.is_empty() && count == 0 {
            return Ok(());
        }
        let width = *values.first().ok_or_else(|| fault("none"))?;
        let mut hybrid =
            Hybrid::new(values.slice(1..), width, count).map_err(|Unsupported| fault("keys of over 32 bits"))?;
        let (mut within, texts) = (true, &mut self.texts);
        let taken = hybrid.each_span(count, |span| match span {
            Span::Same { value, count } => {
                within &= (value as usize) < keys;
                texts.key(value, count);
            }
            Span::Packed(packed) => packed.each(|key| {
                within &= (key as usize) < keys;
                texts.key(key, 1);
            }),
        });
        taken.and_then(|()| hybrid.finish_values()).map_err(|Unsupported| fault("runs of another length"))?;
        if within { Ok(()) } else { Err(fault("a key beyond it")) }
    }

    fn plain(&self, values: &[u8], count: usize) -> Result<(), ContentFault> {
        if count == 0 && values.iter().any(|byte| *byte != 0) {
            return Err(("as many values as its levels say", "some, not 0".to_owned()));
        }
        match self.physical {
            Physical::BOOLEAN if values.len() >= count.div_ceil(8) => Ok(()),
            Physical::BOOLEAN => Err(("a bit for each value", format!("{} bytes for {count}", values.len()))),
            Physical::BYTE_ARRAY => texts(values, count)
                .map_err(|Unsupported| ("texts as long as their lengths say", "texts that end beyond the page".into())),
            _ if count.checked_mul(self.width).is_some_and(|bytes| bytes <= values.len()) => Ok(()),
            _ => Err(other_bytes(values, count, self.width)),
        }
    }
}

fn no_levels(stored: Bytes, rows: usize) -> Result<(), ContentFault> {
    if stored.is_empty() {
        return Ok(());
    }
    let mut hybrid =
        Hybrid::new(stored, 0, rows).map_err(|Unsupported| levels("runs of another length, or levels above 1"))?;
    let over = hybrid.each_span(rows, |_| ()).and_then(|()| hybrid.finish());
    over.map_err(|Unsupported| levels("some above 0"))
}

fn ones(stored: Bytes, count: usize) -> Result<usize, Unsupported> {
    let mut ones = 0;
    let mut hybrid = Hybrid::new(stored, 1, count)?;
    hybrid.each_span(count, |span| match span {
        Span::Same { value, count } => ones += value as usize * count,
        Span::Packed(packed) => packed.each(|bit| ones += bit as usize),
    })?;
    hybrid.finish().map(|()| ones)
}

fn other_bytes(values: &[u8], count: usize, width: usize) -> ContentFault {
    ("as many bytes as its values take", format!("{} for {count} of {width}", values.len()))
}

fn texts(mut values: &[u8], count: usize) -> Result<(), Unsupported> {
    for _ in 0..count {
        let (length, rest) = values.split_first_chunk().ok_or(Unsupported)?;
        values = rest.get(u32::from_le_bytes(*length) as usize..).ok_or(Unsupported)?;
    }
    Ok(())
}

fn delta(values: &[u8], count: usize) -> Result<(), ContentFault> {
    if values.is_empty() && count == 0 {
        return Ok(());
    }
    let opening = delta::Opening::read(values).map_err(|Unsupported| {
        ("the number of its values", "the end of the page, or blocks that are none".to_owned())
    })?;
    let declared = opening.count;
    let fault = || ("as many values as its levels say", format!("{declared}, not {count}"));
    if declared == count as u64 { Ok(()) } else { Err(fault()) }
}

fn levels(found: &str) -> ContentFault {
    ("a definition level of 0 or 1 for each row, and no other level", found.to_owned())
}
