//! Published tables audited under the definitions and the style that they follow.

use std::path::{Path, PathBuf};

use crate::StudyError;
use exact::rounding::Rounding;
use metric::definitions::Definitions;
use metric::implied::implied;
use report::audit::episodes::Episodes;
use report::audit::{Audit, NamedTable, Terms, audit};
use report::published;
use report::style::Style;
use score::vocabulary::{has_value, schema_columns};

#[derive(Clone, Debug)]
pub struct AuditRequest {
    pub episodes: Episodes,
    pub definitions: PathBuf,
    pub steps: u32,
    /// Roundings to consider; all if empty.
    pub roundings: Vec<Rounding>,
    /// The style, whose tables give the meaning of emphasis, and where undefined prints as zero.
    pub style: PathBuf,
}

/// The cells of published tables that no data can produce.
pub fn audit_tables(tables: &[PathBuf], request: &AuditRequest) -> Result<Audit, StudyError> {
    let tables = tables.iter().map(|path| named(path)).collect::<Result<Vec<_>, _>>()?;
    let definitions = Definitions::load(&request.definitions, &schema_columns())?;
    let implied = implied(&definitions.plan, request.steps, has_value);
    let style = Style::load(&request.style)?;
    style.check_against(&definitions.catalog)?;
    let roundings = if request.roundings.is_empty() { &Rounding::ALL[..] } else { &request.roundings };
    let terms = Terms {
        catalog: &definitions.catalog,
        implied: &implied,
        episodes: &request.episodes,
        style: &style,
        roundings,
    };
    Ok(audit(&tables, terms)?)
}

fn named(path: &Path) -> Result<NamedTable, StudyError> {
    let published = published::read(path)?;
    let name = path.file_name().map_or_else(|| path.to_string_lossy(), |name| name.to_string_lossy());
    Ok(NamedTable { name: name.into_owned(), published })
}
