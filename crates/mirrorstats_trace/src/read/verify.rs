//! Checks the stored pages of traces for engines that read files themselves.

use super::footer::plain;
use super::open::{TraceFile, TraceSet};
use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use mirrorstats_parquet_pages::{FaultKind, FaultSlot, PageFault, Place, verify};

/// Reads all pages of all files and checks their headers and, if present, their checksums, without decoding them.
pub fn verify_pages(set: &TraceSet) -> Result<(), TraceError> {
    set.files().iter().try_for_each(|file| Ok(verify_columns(file, |_| true)?))
}

pub(crate) fn verify_columns(file: &TraceFile, is_wanted: impl Fn(&str) -> bool) -> Result<(), Box<Finding>> {
    let readable = file.footer()?;
    let store = file.store()?;
    let (metadata, checksums) = (readable.footer.metadata(), &readable.chunks);
    for (row_group, group) in metadata.row_groups().iter().enumerate() {
        let wanted = |column: &usize| is_wanted(&group.column(*column).column_path().parts()[0]);
        for column in (0..group.num_columns()).filter(wanted) {
            let slot = FaultSlot::default();
            let walked = contained(|| verify(&store, Place { metadata, checksums, row_group, column }, &slot));
            if let Err(error) = walked.and_then(|walked| walked.map_err(|error| plain(&error))) {
                return Err(Box::new(damaged(file.name(), &slot, &error).in_row_group(row_group)));
            }
        }
    }
    Ok(())
}

pub(crate) fn damaged(file: &str, slot: &FaultSlot, error: &str) -> Finding {
    if let Some(PageFault { kind, row_group, column, part, expected, found }) = slot.get() {
        let code = match kind {
            FaultKind::Corrupt => Code::CorruptData,
            FaultKind::OverBudget => Code::OverBudget,
        };
        let expected = format!("{expected} in {part}");
        Finding::new(code, file, expected, found).in_row_group(*row_group).in_column(column)
    } else {
        let found = error.split_whitespace().collect::<Vec<_>>().join(" ");
        Finding::new(Code::CorruptData, file, "data that decodes", found)
    }
}
