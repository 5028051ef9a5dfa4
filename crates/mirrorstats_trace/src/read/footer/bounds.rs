//! Checks a footer's rows and bytes before any page is read: counts add up, columns lie within the file without
//! overlap, and the bytes are enough for the rows.

use parquet::file::metadata::{ParquetMetaData, RowGroupMetaData};

use crate::diagnostic::{Code, Finding};
use crate::read::budget::most_rows;
use mirrorstats_parquet_pages::checksums::range;

/// The most rows per byte of a row group, all columns together. Each episode has its own id and each step its own `t`;
/// the densest traces in use have about one row per byte.
const ROWS_PER_BYTE: u64 = 4096;

pub(crate) fn fault(file: &str, bytes: u64, metadata: &ParquetMetaData) -> Option<Finding> {
    let groups = metadata.row_groups();
    let declared = metadata.file_metadata().num_rows();
    if let Some(fault) = sum_fault(file, declared, groups) {
        return Some(fault);
    }
    let mut ranges = Vec::new();
    for (i, group) in groups.iter().enumerate() {
        if let Some(fault) = group_fault(file, bytes, group, &mut ranges) {
            return Some(fault.in_row_group(i));
        }
    }
    ranges.sort_unstable();
    if ranges.windows(2).any(|pair| pair[0].1 > pair[1].0) {
        return Some(Finding::new(Code::CorruptFooter, file, "columns that lie apart", "two in the same bytes"));
    }
    if let Err(exceeded) = most_rows(bytes).check(declared.cast_unsigned()) {
        return Some(Finding::over_budget(file, &exceeded));
    }
    (declared == 0).then(|| Finding::new(Code::NoEpisodes, file, "at least one episode", "no row"))
}

fn sum_fault(file: &str, declared: i64, groups: &[RowGroupMetaData]) -> Option<Finding> {
    let counted = groups.iter().try_fold(0_i64, |sum, group| {
        let rows = group.num_rows();
        if rows < 0 { None } else { sum.checked_add(rows) }
    });
    if counted == Some(declared) {
        return None;
    }
    let found = counted.map_or("counts that make no sum".to_owned(), |counted| counted.to_string());
    Some(Finding::new(Code::CorruptFooter, file, format!("row groups of {declared} rows together"), found))
}

fn group_fault(file: &str, bytes: u64, group: &RowGroupMetaData, ranges: &mut Vec<(u64, u64)>) -> Option<Finding> {
    let rows = group.num_rows();
    let mut stored = 0_u64;
    for chunk in group.columns() {
        let finding = |expected: &str, found: String| {
            let finding = Finding::new(Code::CorruptFooter, file, expected, found);
            Some(finding.in_column(chunk.column_path().string()))
        };
        if chunk.file_path().is_some_and(|path| !path.is_empty()) {
            return finding("columns in the file itself", "one that lies in another file".into());
        }
        let Some((start, end)) = range(chunk).filter(|(_, end)| *end <= bytes) else {
            return finding("columns that lie within the file", "one that lies outside of it".into());
        };
        let flat = chunk.column_descr().max_rep_level() == 0;
        if chunk.num_values() < 0 || (flat && chunk.num_values() != rows) {
            let expected = format!("columns of {rows} values, as the row group has rows");
            return finding(&expected, chunk.num_values().to_string());
        }
        if end > start {
            ranges.push((start, end));
        }
        stored = stored.saturating_add(end - start);
    }
    if rows.cast_unsigned() > stored.saturating_mul(ROWS_PER_BYTE) {
        let expected = format!("no more rows than {stored} bytes can hold");
        return Some(Finding::new(Code::CorruptFooter, file, expected, rows.to_string()));
    }
    None
}
