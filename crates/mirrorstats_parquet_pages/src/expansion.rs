//! Limits of expansion: inflated bytes, written-out texts.
//!
//! A page of a few bytes may expand to megabytes, and a run of a few bytes to millions of rows. Rule: the expanded size
//! grows with the file. In the densest traces in use one byte gives one row. A byte of compressed text of other
//! writers, which write out the names of each step, gives some fifty bytes. The floors are for small files, mostly
//! footer.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use arrow::array::{AsArray as _, StringArray};
use arrow::datatypes::{DataType, Int32Type};

use crate::column::Column;
use mirrorstats_exact::budget::{Budget, Exceeded, Limit};

/// The largest expansion of a stored byte, for the first `SMALL` bytes.
pub const INFLATED_PER_BYTE: u64 = 96;

/// Up to this size the file as a whole sets the limit, beyond it the possible contents of its pages.
const SMALL: u64 = 1 << 20;

/// The largest expansion per byte beyond [`SMALL`]: plain columns that hardly change, of writers without dictionaries,
/// come near the 1032 of deflate.
const INFLATED_PER_BYTE_BEYOND: u64 = 1024;

/// Texts whose rows together must be small are not counted.
const UNCOUNTED: usize = 64 << 10;

/// The expansion of a file so far. Parts that are read again are counted once.
#[derive(Debug)]
pub struct Expansion {
    inflated: Budget,
    written_out: Budget,
    read: Mutex<HashMap<(ExpansionKind, usize, usize), u64>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum ExpansionKind {
    Page,
    PageTexts,
    Rows,
    Written,
}

impl Expansion {
    pub fn new(bytes: u64) -> Self {
        let of = |what| {
            Limit::in_proportion(what, 64 << 20, INFLATED_PER_BYTE, bytes.min(SMALL)).and_beyond(
                SMALL,
                INFLATED_PER_BYTE_BEYOND,
                bytes,
            )
        };
        let inflated = of("bytes inflated from a file of its size");
        let written_out = of("bytes of texts in the rows of a file of its size");
        Self { inflated: Budget::new(inflated), written_out: Budget::new(written_out), read: Mutex::default() }
    }

    /// A page of `bytes` that starts at `offset` of the file, in a column of a row group.
    pub(crate) fn page(&self, place: (usize, usize), offset: u64, bytes: usize) -> Result<(), Exceeded> {
        if self.is_new(ExpansionKind::Page, place, offset + 1) { self.inflated.spend(bytes as u64) } else { Ok(()) }
    }

    /// A page at `offset` whose written-out texts take `bytes`.
    pub(crate) fn texts(&self, place: (usize, usize), offset: u64, bytes: u64) -> Result<(), Exceeded> {
        if self.is_new(ExpansionKind::PageTexts, place, offset + 1) { self.written_out.spend(bytes) } else { Ok(()) }
    }

    /// Rows from `first` on of a column of a row group.
    pub fn rows(&self, place: (usize, usize), first: usize, column: &Column) -> Result<(), Exceeded> {
        let bytes = bytes_of_texts(column);
        if bytes == 0 || !self.is_new(ExpansionKind::Rows, place, (first + column.len()) as u64) {
            return Ok(());
        }
        self.written_out.spend(bytes)
    }

    /// Texts of `bytes` that are written out for the rows of a column of a row group up to `end`.
    pub fn written(&self, place: (usize, usize), end: usize, bytes: u64) -> Result<(), Exceeded> {
        if self.is_new(ExpansionKind::Written, place, end as u64) { self.written_out.spend(bytes) } else { Ok(()) }
    }

    fn is_new(&self, kind: ExpansionKind, (row_group, column): (usize, usize), at: u64) -> bool {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        let last = read.entry((kind, row_group, column)).or_default();
        let is_new = at > *last;
        *last = at.max(*last);
        is_new
    }
}

/// The bytes of the texts of all rows of a text column; 0 if they must be few.
fn bytes_of_texts(column: &Column) -> u64 {
    let length = |texts: &StringArray, at: usize| u64::from(texts.value_length(at).cast_unsigned());
    if let Some((keys, texts)) = column.byte_texts() {
        if texts.value_data().len() <= UNCOUNTED {
            return 0;
        }
        return keys.iter().flatten().map(|key| length(texts, key.into())).sum();
    }
    // Runs have one key each, and are few.
    let (Column::Flat(values), DataType::Dictionary(..)) = (column, column.data_type()) else { return 0 };
    let values = values.as_dictionary::<Int32Type>();
    let texts = values.values().as_string::<i32>();
    if texts.value_data().len() <= UNCOUNTED {
        return 0;
    }
    values.keys().iter().flatten().filter_map(|key| usize::try_from(key).ok()).map(|key| length(texts, key)).sum()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::{ArrayRef, DictionaryArray, Int32Array, StringArray, UInt8Array};
    use arrow::datatypes::Int32Type;

    use super::{Expansion, bytes_of_texts};
    use crate::column::{Column, Keys};

    fn texts(length: usize) -> ArrayRef {
        Arc::new(StringArray::from(vec!["x".repeat(length), "y".to_owned()]))
    }

    #[test]
    fn repeated_reads_count_once() {
        let expansion = Expansion::new(0);
        let half = (64 << 20) / 2;
        assert!(expansion.page((0, 0), 4, half).is_ok() && expansion.page((0, 0), 4, half).is_ok());
        assert!(expansion.page((0, 1), 4, half).is_ok());
        assert!(expansion.page((1, 0), 4, 1).is_err());
    }

    #[test]
    fn a_large_file_may_hold_columns_that_hardly_change() {
        let large = 10 << 20;
        assert!(Expansion::new(large).page((0, 0), 4, 1000 * (9 << 20)).is_ok());
        assert!(Expansion::new(large).page((0, 0), 4, 1100 * (9 << 20)).is_err());
        assert!(Expansion::new(1 << 20).page((0, 0), 4, (64 + 97) << 20).is_err());
    }

    #[test]
    fn a_text_counts_for_each_row_that_has_it() {
        for (length, expected) in [(100, 0), (100_000, 300_001)] {
            let keys: UInt8Array = vec![Some(0), None, Some(1), Some(0), Some(0)].into();
            let keyed = Column::Keys(Keys::new(keys, texts(length)).unwrap());
            let keys: Int32Array = vec![Some(0), None, Some(1), Some(0), Some(0)].into();
            let flat = Arc::new(DictionaryArray::<Int32Type>::try_new(keys, texts(length)).unwrap()) as ArrayRef;
            assert_eq!((bytes_of_texts(&keyed), bytes_of_texts(&Column::Flat(flat))), (expected, expected));
        }
    }
}
