//! Counts how many rows use each entry of a column of texts. Rows are keys into the entries, and some entries are unused.

use arrow::array::{Array as _, AsArray as _, PrimitiveArray, StringArray};
use arrow::datatypes::{ArrowNativeType, ArrowPrimitiveType, Int32Type};

use mirrorstats_parquet_pages::{Column, Runs};

#[derive(Clone, Debug)]
pub(crate) struct EntryUse {
    entries: StringArray,
    rows: Vec<u64>,
    pub(crate) nulls: u64,
}

impl EntryUse {
    pub(crate) fn of_column(column: &Column) -> Option<Self> {
        let entries = entries(column)?.clone();
        let mut counted = Self { rows: vec![0; entries.len()], entries, nulls: 0 };
        counted.add(column);
        Some(counted)
    }

    /// Adds a column's rows if it has the very same entries; otherwise returns false.
    pub(crate) fn extend(&mut self, column: &Column) -> bool {
        // These entries stay in memory, so other entries have another address.
        let is_same = entries(column).is_some_and(|entries| {
            entries.len() == self.entries.len()
                && entries.value_offsets().as_ptr() == self.entries.value_offsets().as_ptr()
        });
        if is_same {
            self.add(column);
        }
        is_same
    }

    pub(crate) fn entries(&self) -> impl Iterator<Item = &str> + Clone {
        self.entries.iter().flatten()
    }

    pub(crate) fn used(&self) -> impl Iterator<Item = (&str, u64)> {
        let used = self.entries.iter().zip(&self.rows).filter(|(_, rows)| **rows > 0);
        used.filter_map(|(text, rows)| Some((text?, *rows)))
    }

    /// The entries that rows of this column use, each with its first row and the number of its rows.
    pub(crate) fn first_rows(&self, column: &Column) -> Vec<(&str, usize, u64)> {
        let mut first = vec![usize::MAX; self.rows.len()];
        let mut left = self.rows.iter().filter(|rows| **rows > 0).count();
        // Returns true once all entries are met, which is soon in most columns.
        let mut meet = |row: usize, key: Option<usize>| {
            if let Some(first) = key.and_then(|key| first.get_mut(key)).filter(|first| **first == usize::MAX) {
                *first = row;
                left -= 1;
            }
            left == 0
        };
        match column {
            Column::Flat(values) => {
                let mut keys = values.as_dictionary::<Int32Type>().keys().iter().enumerate();
                keys.any(|(row, key)| meet(row, key.map(ArrowNativeType::as_usize)))
            }
            Column::Keys(keyed) => {
                keyed.keys().iter().enumerate().any(|(row, key)| meet(row, key.map(ArrowNativeType::as_usize)))
            }
            Column::Runs(runs) => {
                let values = runs.values().as_dictionary::<Int32Type>();
                lengths(runs).any(|(row, run, _)| meet(row, values.key(run)))
            }
        };
        let used = self.entries.iter().zip(first).zip(&self.rows).filter(|(_, rows)| **rows > 0);
        used.filter_map(|((text, first), rows)| Some((text?, first, *rows))).collect()
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.used().map(|(text, rows)| text.len() as u64 * rows).sum()
    }

    fn add(&mut self, column: &Column) {
        let Self { rows, nulls, .. } = self;
        match column {
            Column::Flat(values) => count(values.as_dictionary::<Int32Type>().keys(), rows, nulls),
            Column::Keys(keyed) => count(keyed.keys(), rows, nulls),
            Column::Runs(runs) => {
                let values = runs.values().as_dictionary::<Int32Type>();
                for (_, run, length) in lengths(runs) {
                    *values.key(run).and_then(|key| rows.get_mut(key)).unwrap_or(nulls) += length;
                }
            }
        }
    }
}

fn entries(column: &Column) -> Option<&StringArray> {
    let dictionary = match column {
        Column::Keys(keyed) => return keyed.values().as_string_opt(),
        Column::Flat(values) => values,
        Column::Runs(runs) => runs.values(),
    };
    dictionary.as_dictionary_opt::<Int32Type>()?.values().as_string_opt()
}

pub(crate) fn count<K: ArrowPrimitiveType>(keys: &PrimitiveArray<K>, rows: &mut [u64], nulls: &mut u64) {
    if keys.null_count() > 0 {
        *nulls += keys.null_count() as u64;
        return keys.iter().flatten().for_each(|key| rows[key.as_usize()] += 1);
    }
    if rows.len() > 256 {
        return keys.values().iter().for_each(|key| rows[key.as_usize()] += 1);
    }
    // With few keys, most rows repeat the one before, whose count is being written. Four counts do not wait for it.
    let mut parts = [[0_u64; 256]; 4];
    for four in keys.values().chunks(4) {
        four.iter().zip(&mut parts).for_each(|(key, part)| part[key.as_usize() & 255] += 1);
    }
    rows.iter_mut().enumerate().for_each(|(key, rows)| *rows += parts.iter().map(|part| part[key]).sum::<u64>());
}

/// The first row of each run, the position of its value, and its length.
pub(crate) fn lengths(runs: &Runs) -> impl Iterator<Item = (usize, usize, u64)> {
    let starts: Vec<(usize, usize)> = runs.starts().collect();
    let ends: Vec<usize> = starts.iter().skip(1).map(|(start, _)| *start).chain([runs.rows()]).collect();
    starts.into_iter().zip(ends).map(|((start, run), end)| (start, run, (end - start) as u64))
}
