//! Counts how many rows use each entry of a column of texts. Rows are keys into the entries, and some entries are unused.

use arrow::array::{Array as _, AsArray as _, StringArray};
use arrow::datatypes::{ArrowNativeType, Int32Type};

use mirrorstats_parquet_pages::Column;

pub(crate) struct EntryUse<'c> {
    pub(crate) entries: &'c StringArray,
    /// For each entry its first row, and the number of its rows; `None` if no row has it.
    pub(crate) used: Vec<Option<(usize, u64)>>,
    pub(crate) nulls: u64,
}

impl<'c> EntryUse<'c> {
    /// The use of a column's texts; `None` for columns of other types.
    pub(crate) fn of_column(column: &'c Column) -> Option<Self> {
        Some(match column {
            Column::Flat(values) => {
                let values = values.as_dictionary_opt::<Int32Type>()?;
                let keys = values.keys().iter().map(|key| key.map(ArrowNativeType::as_usize));
                Self::count(values.values().as_string_opt()?, keys.enumerate().map(|(row, key)| (row, key, 1)))
            }
            Column::Keys(keyed) => {
                let keys = keyed.keys().iter().map(|key| key.map(usize::from));
                Self::count(keyed.values().as_string_opt()?, keys.enumerate().map(|(row, key)| (row, key, 1)))
            }
            Column::Runs(runs) => {
                let values = runs.values().as_dictionary_opt::<Int32Type>()?;
                let starts: Vec<(usize, usize)> = runs.starts().collect();
                let ends = starts.iter().skip(1).map(|(start, _)| *start).chain([column.len()]);
                let rows = starts.iter().zip(ends);
                let rows = rows.map(|((start, run), end)| (*start, values.key(*run), (end - start) as u64));
                Self::count(values.values().as_string_opt()?, rows)
            }
        })
    }

    fn count(entries: &'c StringArray, rows: impl Iterator<Item = (usize, Option<usize>, u64)>) -> Self {
        let (mut used, mut nulls) = (vec![None; entries.len()], 0);
        for (row, key, count) in rows {
            match key.and_then(|key| used.get_mut(key)) {
                Some(used) => used.get_or_insert((row, 0)).1 += count,
                None => nulls += count,
            }
        }
        Self { entries, used, nulls }
    }
}
