//! Reads one column of one row group, some rows at a time.

use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray};
use arrow::buffer::{BooleanBuffer, NullBuffer};
use arrow::datatypes::DataType;
use bytes::Bytes;
use parquet::basic::{Encoding, Type as Physical};
use parquet::column::page::{Page, PageReader as _};

use super::dictionary::Dictionary;
use super::rle::{Hybrid, Number, Span, prefixed};
use crate::bits::Bits;
use crate::column::{Column, Runs, narrow};
use crate::error::{FaultSlot, Unsupported};
use crate::stored::bytes::{Place, Store};
use crate::stored::reader::Pages;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// One value per row, or one key per row.
    Rows,
    /// One value per run.
    Runs,
}

pub struct Cursor {
    pages: Pages,
    physical: Physical,
    optional: bool,
    form: Form,
    dictionary: Option<Dictionary>,
    page: Option<DataPage>,
    unread: usize,
}

struct DataPage {
    rows: usize,
    valid: usize,
    expected: Option<usize>,
    levels: Option<Hybrid>,
    values: Stored,
}

enum Stored {
    /// Keys into the dictionary, or runs of truth values.
    Hybrid(Hybrid),
    /// Truth values from this bit on.
    Bits(Bytes, usize),
}

#[derive(Default)]
struct Stretches {
    keys: Vec<i32>,
    /// The end of each run (exclusive).
    ends: Vec<u32>,
}

impl Cursor {
    pub fn open(store: &Store, place: Place<'_>, stored: &DataType, form: Form) -> Result<Self, Unsupported> {
        let (column, rows) = (place.chunk(), place.rows());
        let about = column.column_descr();
        let physical = about.physical_type();
        let known = match stored {
            DataType::Boolean => physical == Physical::BOOLEAN,
            DataType::Int32 => physical == Physical::INT32,
            DataType::Int64 => physical == Physical::INT64,
            DataType::Dictionary(_, _) => physical == Physical::BYTE_ARRAY,
            _ => false,
        };
        let alone = about.max_rep_level() == 0 && about.max_def_level() <= 1 && about.path().parts().len() == 1;
        let whole = usize::try_from(column.num_values()).is_ok_and(|values| values == rows);
        let keyed = physical == Physical::BOOLEAN || column.dictionary_page_offset().is_some();
        if !(known && alone && whole && keyed) {
            return Err(Unsupported);
        }
        Ok(Self {
            pages: Pages::new(store, place, FaultSlot::default()).map_err(|_| Unsupported)?,
            physical,
            optional: about.max_def_level() == 1,
            form: if physical == Physical::BOOLEAN { Form::Rows } else { form },
            dictionary: None,
            page: None,
            unread: rows,
        })
    }

    pub fn read(&mut self, count: usize) -> Result<Column, Unsupported> {
        if count > 0 {
            // The dictionary comes before the first values.
            self.page()?;
        }
        if self.physical == Physical::BOOLEAN {
            return self.truths(count);
        }
        if self.form == Form::Runs {
            return self.runs(count);
        }
        if self.dictionary()?.is_small() {
            let (keys, nulls) = self.keys(count)?;
            return self.dictionary()?.keys(keys, nulls).map(Column::Keys);
        }
        let (keys, nulls) = self.keys(count)?;
        self.dictionary()?.values(keys, nulls).map(Column::Flat)
    }

    fn dictionary(&self) -> Result<&Dictionary, Unsupported> {
        self.dictionary.as_ref().ok_or(Unsupported)
    }

    fn truths(&mut self, count: usize) -> Result<Column, Unsupported> {
        let mut bits = Bits::with_capacity(count);
        let nulls = self.rows(count, |stored, _, values| stored.bits(values, &mut bits))?;
        let bits = bits.finish();
        let bits = nulls.as_ref().map_or_else(|| bits.clone(), |nulls| spread_bits(&bits, nulls.inner()));
        Ok(Column::Flat(Arc::new(BooleanArray::new(bits, nulls)) as ArrayRef))
    }

    fn runs(&mut self, count: usize) -> Result<Column, Unsupported> {
        let mut stretches = Stretches::default();
        self.rows(count, |stored, rows, values| {
            // Nulls among rows read as runs are rare, so the library decodes them.
            if rows != values {
                return Err(Unsupported);
            }
            stored.hybrid()?.each_span(values, |span| match span {
                Span::Same { value, count } => stretches.add(value.cast_signed(), count),
                Span::Packed(packed) => packed.blocks(|values| stretches.add_each(values)),
            })
        })?;
        Ok(Column::Runs(Runs::new(self.dictionary()?.values(stretches.keys, None)?, stretches.ends)))
    }

    /// The keys of the next rows; 0 for null.
    fn keys<N: Number>(&mut self, count: usize) -> Result<(Vec<N>, Option<NullBuffer>), Unsupported> {
        let mut keys = Vec::with_capacity(count);
        let nulls = self.rows(count, |stored, _, values| stored.hybrid()?.append(values, &mut keys))?;
        let keys = match &nulls {
            Some(nulls) => spread_keys(&keys, nulls.inner()),
            None => keys,
        };
        Ok((keys, nulls))
    }

    /// Reads the next rows page by page. `take` gets the stored data, the number of rows and the number of values,
    /// which excludes nulls.
    fn rows(
        &mut self,
        count: usize,
        mut take: impl FnMut(&mut Stored, usize, usize) -> Result<(), Unsupported>,
    ) -> Result<Option<NullBuffer>, Unsupported> {
        let mut nulls = self.optional.then(|| Bits::with_capacity(count));
        let mut left = count;
        while left > 0 {
            let page = self.page()?;
            let rows = left.min(page.rows);
            page.rows -= rows;
            let values = match (&mut page.levels, &mut nulls) {
                (Some(levels), Some(nulls)) => append(levels, rows, nulls)?,
                _ => rows,
            };
            page.valid += values;
            take(&mut page.values, rows, values)?;
            self.unread -= rows;
            left -= rows;
        }
        if self.unread == 0 {
            self.close_page()?;
            if self.next_page()?.is_some() {
                return Err(Unsupported);
            }
        }
        Ok(nulls.map(|nulls| NullBuffer::new(nulls.finish())).filter(|nulls| nulls.null_count() > 0))
    }

    fn page(&mut self) -> Result<&mut DataPage, Unsupported> {
        while self.page.as_ref().is_none_or(|page| page.rows == 0) {
            self.close_page()?;
            self.page = Some(self.next_page()?.ok_or(Unsupported)?);
        }
        self.page.as_mut().ok_or(Unsupported)
    }

    /// Closes the current page, which must be read to its end.
    fn close_page(&mut self) -> Result<(), Unsupported> {
        self.page.take().map_or(Ok(()), |page| page.finish())
    }

    fn next_page(&mut self) -> Result<Option<DataPage>, Unsupported> {
        loop {
            let Some(page) = self.pages.get_next_page().map_err(|_| Unsupported)? else { return Ok(None) };
            match page {
                Page::DictionaryPage { buf, num_values, encoding, .. } => {
                    if self.dictionary.is_some() || !matches!(encoding, Encoding::PLAIN | Encoding::PLAIN_DICTIONARY) {
                        return Err(Unsupported);
                    }
                    let count = num_values as usize;
                    self.dictionary = Some(match self.physical {
                        Physical::BYTE_ARRAY => Dictionary::texts(&buf, count)?,
                        Physical::INT32 => Dictionary::ints(&buf, count, false)?,
                        _ => Dictionary::ints(&buf, count, true)?,
                    });
                }
                Page::DataPage { buf, num_values, encoding, def_level_encoding, .. } => {
                    let (levels, values) = match self.optional {
                        true if def_level_encoding == Encoding::RLE => {
                            let (levels, values) = prefixed(&buf)?;
                            (Some(levels), values)
                        }
                        true => return Err(Unsupported),
                        false => (None, buf),
                    };
                    return self.data_page((num_values, None), levels, values, encoding).map(Some);
                }
                Page::DataPageV2 {
                    buf,
                    num_values,
                    num_nulls,
                    encoding,
                    def_levels_byte_len,
                    rep_levels_byte_len,
                    ..
                } => {
                    let levels = def_levels_byte_len as usize;
                    // Levels of a required column are rare; the library's path checks them.
                    if levels > buf.len() || rep_levels_byte_len > 0 || (levels > 0 && !self.optional) {
                        return Err(Unsupported);
                    }
                    let valid = num_values.checked_sub(num_nulls).ok_or(Unsupported)?;
                    let values = buf.slice(levels..);
                    let levels = self.optional.then(|| buf.slice(..levels));
                    return self.data_page((num_values, Some(valid)), levels, values, encoding).map(Some);
                }
            }
        }
    }

    fn data_page(
        &self,
        (rows, valid): (u32, Option<u32>),
        levels: Option<Bytes>,
        values: Bytes,
        encoding: Encoding,
    ) -> Result<DataPage, Unsupported> {
        let rows = rows as usize;
        if rows > self.unread {
            return Err(Unsupported);
        }
        let levels = levels.map(|levels| Hybrid::new(levels, 1, rows)).transpose()?;
        let values = match (self.physical, encoding) {
            (Physical::BOOLEAN, Encoding::PLAIN) => Stored::Bits(values, 0),
            (Physical::BOOLEAN, Encoding::RLE) => Stored::Hybrid(Hybrid::new(prefixed(&values)?.0, 1, rows)?),
            (Physical::BOOLEAN, _) => return Err(Unsupported),
            (_, Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY) if self.dictionary.is_some() => {
                // A page with only nulls may have no width: the library decides whether that is valid.
                let width = *values.first().ok_or(Unsupported)?;
                Stored::Hybrid(Hybrid::new(values.slice(1..), width, rows)?)
            }
            _ => return Err(Unsupported),
        };
        Ok(DataPage { rows, valid: 0, expected: valid.map(|valid| valid as usize), levels, values })
    }
}

impl DataPage {
    fn finish(&self) -> Result<(), Unsupported> {
        if self.rows > 0 || self.expected.is_some_and(|expected| expected != self.valid) {
            return Err(Unsupported);
        }
        self.levels.as_ref().map_or(Ok(()), Hybrid::finish)?;
        match &self.values {
            Stored::Hybrid(values) => values.finish_values(),
            Stored::Bits(values, 0) if values.iter().any(|byte| *byte != 0) => Err(Unsupported),
            Stored::Bits(..) => Ok(()),
        }
    }
}

impl Stored {
    fn hybrid(&mut self) -> Result<&mut Hybrid, Unsupported> {
        match self {
            Self::Hybrid(hybrid) => Ok(hybrid),
            Self::Bits(..) => Err(Unsupported),
        }
    }

    fn bits(&mut self, count: usize, bits: &mut Bits) -> Result<(), Unsupported> {
        match self {
            Self::Bits(data, at) => {
                let end = *at + count;
                if end > data.len() * 8 {
                    return Err(Unsupported);
                }
                bits.append(data, *at, count);
                *at = end;
                Ok(())
            }
            Self::Hybrid(hybrid) => append(hybrid, count, bits).map(drop),
        }
    }
}

impl Stretches {
    fn add(&mut self, key: i32, count: usize) {
        let count = narrow(count);
        match (self.keys.last(), self.ends.last_mut()) {
            (Some(last), Some(end)) if *last == key => *end += count,
            (_, end) => {
                let before = end.map_or(0, |end| *end);
                self.keys.push(key);
                self.ends.push(before + count);
            }
        }
    }

    fn add_each(&mut self, keys: &[i32]) {
        // Most of the time all keys belong to one or two episodes.
        keys.chunk_by(|a, b| a == b).for_each(|same| self.add(same[0], same.len()));
    }
}

/// Adds one-bit numbers. Returns the number of ones.
fn append(numbers: &mut Hybrid, count: usize, out: &mut Bits) -> Result<usize, Unsupported> {
    let mut ones = 0;
    numbers.each_span(count, |span| match span {
        Span::Same { value, count } => {
            // A number of one bit: wider runs are refused.
            out.fill(count, value == 1);
            ones += value as usize * count;
        }
        Span::Packed(packed) => {
            let (data, start) = packed.bits();
            ones += out.append(data, start, packed.count);
        }
    })?;
    Ok(ones)
}

/// Moves values, which are stored without nulls between them, to their rows.
fn spread_keys<N: Number>(keys: &[N], valid: &BooleanBuffer) -> Vec<N> {
    let mut spread = vec![N::default(); valid.len()];
    let mut keys = keys;
    for (start, end) in valid.set_slices() {
        let (here, rest) = keys.split_at(keys.len().min(end - start));
        spread[start..start + here.len()].copy_from_slice(here);
        keys = rest;
    }
    spread
}

fn spread_bits(bits: &BooleanBuffer, valid: &BooleanBuffer) -> BooleanBuffer {
    let mut spread = Bits::with_capacity(valid.len());
    let mut taken = bits.offset();
    for (start, end) in valid.set_slices() {
        spread.fill(start - spread.count(), false);
        spread.append(bits.values(), taken, end - start);
        taken += end - start;
    }
    spread.fill(valid.len() - spread.count(), false);
    spread.finish()
}
