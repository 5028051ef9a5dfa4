//! The tables of a study beside published ones.

use std::path::Path;

use crate::tables::tables;
use crate::{Study, StudyError};
use mirrorstats_report::published;
use mirrorstats_report::published::comparison::{self, PublishedComparison, choose};
use mirrorstats_report::published::errata;
use mirrorstats_report::style::Style;

/// Compares a table of the study with a published one, cell by cell: the first that has all the published metrics. The
/// paper's style knows the slips of the paper's tables. Errors: faults of the published table, the style or the inputs;
/// no such table.
pub fn compare(study: &Study, published: &Path, style: &Path) -> Result<PublishedComparison, StudyError> {
    // Small files first: a mistake in them should not cost a scan of the traces.
    let published = published::read(published)?;
    let errata = if style == Path::new("paper") { errata::of_paper() } else { Vec::new() };
    let style = Style::load(style)?;
    let (tables, _) = tables(&study.grouped()?, &style)?;
    Ok(comparison::compare(choose(&tables, &published, &style)?, &published, &errata))
}
