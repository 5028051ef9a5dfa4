//! The episode ids of row groups, decoded ahead of their other columns.
//!
//! They show where a row group can be cut without splitting an episode, and whether the episodes at its ends continue
//! in its neighbours. Rule: each row group's ids are decoded once, by the first thread that asks, and the results
//! depend only on the files. Ids that are not held as runs are not decoded ahead, and stay unknown.

use std::sync::{Mutex, OnceLock, PoisonError};

use super::decode::{Ids, ids};
use super::open::TraceFile;
use super::projection::Layout;
use mirrorstats_parquet_pages::{Column, Runs};

/// Row groups with more rows are not decoded ahead, to save memory.
const MOST_ROWS: usize = 4 << 20;

pub(crate) struct Ahead<'a> {
    files: &'a [TraceFile],
    layout: &'a Layout,
    groups: Vec<Vec<OnceLock<Option<Group>>>>,
}

struct Group {
    first: String,
    last: String,
    runs: Mutex<Option<Runs>>,
}

impl<'a> Ahead<'a> {
    pub(crate) fn new(files: &'a [TraceFile], layout: &'a Layout) -> Self {
        let groups = files.iter().map(|file| (0..file.row_groups()).map(|_| OnceLock::new()).collect()).collect();
        Self { files, layout, groups }
    }

    /// The ids of a row group, for the first caller; `None` if they are not held as runs.
    pub(crate) fn take(&self, file: usize, row_group: usize) -> Option<Ids> {
        let group = self.group(file, row_group)?;
        let runs = group.runs.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        let has_rows = |row_group: &usize| self.files[file].row_group_rows(*row_group) > 0;
        let before = (0..row_group).rev().find(has_rows);
        let after = (row_group + 1..self.files[file].row_groups()).find(has_rows);
        let known = |other: usize| self.group(file, other);
        Some(Ids {
            runs,
            begins: before.is_none_or(|before| known(before).is_some_and(|other| other.last != group.first)),
            ends: after.is_none_or(|after| known(after).is_some_and(|other| other.first != group.last)),
        })
    }

    fn group(&self, file: usize, row_group: usize) -> Option<&Group> {
        self.groups[file][row_group].get_or_init(|| self.decode(file, row_group)).as_ref()
    }

    fn decode(&self, file: usize, row_group: usize) -> Option<Group> {
        let file = &self.files[file];
        let rows = file.row_group_rows(row_group);
        if rows == 0 || rows > MOST_ROWS {
            return None;
        }
        let column = ids(file, self.layout, row_group)?;
        let text = |row: usize| column.text(row).map(str::to_owned);
        let (first, last) = (text(0)?, text(rows - 1)?);
        let Column::Runs(runs) = column else { return None };
        Some(Group { first, last, runs: Mutex::new(Some(runs)) })
    }
}
