//! Limits on the contents of a trace: rows, columns, episodes, the length of names and episodes. `parquet_pages` limits
//! the inflated size of pages.

use arrow::array::{Array as _, AsArray as _};

use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_parquet_pages::Column;

/// The longest name of an episode, model, condition or colour: names are in every row of the outputs.
pub(crate) const LONGEST_NAME: Limit = Limit::new("bytes in a name", 1024);

/// The most steps of an episode, which is held in memory as a whole.
pub(crate) const LONGEST_EPISODE: Limit = Limit::new("steps in an episode", 1 << 22);

pub(crate) const MOST_COLUMNS: Limit = Limit::new("columns in a file", 10_000);

pub(crate) fn most_rows(bytes: u64) -> Limit {
    Limit::in_proportion("rows in a file of its size", 8_000_000, 16, bytes)
}

/// The most episodes. A row takes a byte in the densest traces, and an episode has several rows.
pub(crate) const fn most_episodes(bytes: u64) -> Limit {
    Limit::new("episodes in files of their size", 300_000).and_beyond(1 << 20, 1, bytes)
}

/// The most episodes of a list: each takes a kilobyte when printed.
pub(crate) const fn most_listed(bytes: u64) -> Limit {
    Limit::in_proportion("episodes in a list of files of their size", 100_000, 1, bytes / 8)
}

/// The most values of an episode whose rows are read in parts and joined: each takes up to 8 bytes.
pub(crate) const fn most_joined(bytes: u64) -> Limit {
    Limit::new("steps times columns of an episode", 48_000_000).and_beyond(1 << 20, 8, bytes)
}

/// The most values of an episode held row by row: its steps times the columns of its file.
pub(crate) const fn most_values(bytes: u64) -> Limit {
    Limit::new("steps times columns of an episode that is shown", 2_000_000).and_beyond(1 << 20, 4, bytes)
}

/// The most memory of such an episode before it is shown.
pub(crate) const fn most_shown(bytes: u64) -> Limit {
    Limit::new("bytes of an episode that is shown", 48 << 20).and_beyond(1 << 20, 64, bytes)
}

pub(crate) fn check_names(column: &Column) -> Result<(), Exceeded> {
    let entries = column.entries();
    let Some(texts) = entries.as_string_opt::<i32>() else { return Ok(()) };
    if LONGEST_NAME.check(texts.value_data().len() as u64).is_ok() {
        return Ok(());
    }
    let longest = (0..texts.len()).map(|at| texts.value_length(at)).max().unwrap_or_default();
    LONGEST_NAME.check(u64::from(longest.cast_unsigned()))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use arrow::array::StringArray;
    use mirrorstats_parquet_pages::{Column, Keys};

    use super::check_names;

    #[test]
    fn long_names_are_refused() {
        let names = |length: usize| {
            Column::Keys(Keys::new(vec![0_u8].into(), Arc::new(StringArray::from(vec!["x".repeat(length)]))).unwrap())
        };
        assert!(check_names(&names(1024)).is_ok() && check_names(&names(1025)).is_err());
    }
}
