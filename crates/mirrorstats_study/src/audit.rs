//! Published tables audited under definitions.

use std::path::{Path, PathBuf};

use crate::StudyError;
use mirrorstats_exact::rounding::Rounding;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_report::published::audit::{Audit, audit};
use mirrorstats_report::published::{self, Published};
use mirrorstats_score::vocabulary::schema_columns;

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
