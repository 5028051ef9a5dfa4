//! What definitions expect of the traces that they score.

use std::path::Path;

use super::StudyError;
use metric::definitions::Definitions;
use score::score_traces::{declared_columns, schema_columns};
use trace::schema::{DeclaredColumn, Domain};
use trace::validate::Expected;

/// What definitions expect of traces.
#[derive(Clone, Debug)]
pub(super) struct ExpectedTraces {
    /// The experiments that they know; any if `None`.
    pub(super) experiments: Option<Vec<String>>,
    /// The name of their domain; `None` for the mirror's.
    pub(super) domain: Option<String>,
    pub(super) declared: Vec<DeclaredColumn>,
}

impl ExpectedTraces {
    pub(super) fn of(definitions: &Path) -> Result<Self, StudyError> {
        let definitions = Definitions::load(definitions, &schema_columns())?;
        let declared = declared_columns(&definitions);
        let catalog = definitions.catalog;
        let experiments = (!catalog.open).then(|| catalog.experiment.keys().cloned().collect());
        Ok(Self { experiments, domain: catalog.domain, declared })
    }

    pub(super) fn as_expected(&self) -> Expected<'_> {
        let domain = if self.domain.is_some() { Domain::Own } else { Domain::Mirror };
        Expected { experiments: self.experiments.as_deref(), domain, declared: &self.declared, errors_alone: false }
    }
}
