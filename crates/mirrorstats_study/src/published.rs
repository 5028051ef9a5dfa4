//! Published tables: beside those of a study, and audited under definitions.

use std::path::{Path, PathBuf};

use crate::tables::tables;
use crate::{Study, StudyError};
use mirrorstats_exact::rounding::Rounding;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_report::published::audit::{Audit, audit};
use mirrorstats_report::published::comparison::{self, PublishedComparison, choose};
use mirrorstats_report::published::{self, Published, errata};
use mirrorstats_report::style::Style;
use mirrorstats_score::vocabulary::schema_columns;

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

/// The cells of published tables that `n` episodes cannot give under any of these roundings.
pub fn audit_tables(
    tables: &[PathBuf],
    n: u64,
    definitions: &Path,
    roundings: &[Rounding],
) -> Result<Audit, StudyError> {
    let tables = tables.iter().map(|path| named(path)).collect::<Result<Vec<_>, _>>()?;
    let definitions = Definitions::load(definitions, &schema_columns())?;
    Ok(audit(&tables, &definitions.catalog, n, roundings)?)
}

fn named(path: &Path) -> Result<(String, Published), StudyError> {
    let name = path.file_name().map_or_else(|| path.to_string_lossy(), |name| name.to_string_lossy());
    Ok((name.into_owned(), published::read(path)?))
}
