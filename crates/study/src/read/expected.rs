//! Requirements of definitions on the traces that they score.

use std::path::Path;

use crate::StudyError;
use metric::definitions::Definitions;
use score::vocabulary::{declared_columns, schema_columns};
use trace::schema::{DeclaredColumn, Domain};
use trace::validate::Expected;

#[derive(Clone, Debug)]
pub(crate) struct ExpectedTraces {
    /// The known experiments; any if `None`.
    pub(crate) experiments: Option<Vec<String>>,
    /// The name of their domain; `None` for the mirror's.
    pub(crate) domain: Option<String>,
    pub(crate) declared: Vec<DeclaredColumn>,
}

impl ExpectedTraces {
    pub(crate) fn of(definitions: &Path) -> Result<Self, StudyError> {
        let definitions = Definitions::load(definitions, &schema_columns())?;
        let declared = declared_columns(&definitions);
        let catalog = definitions.catalog;
        let experiments = (!catalog.open).then(|| catalog.experiment.keys().cloned().collect());
        Ok(Self { experiments, domain: catalog.domain, declared })
    }

    pub(crate) fn as_expected(&self) -> Expected<'_> {
        let domain = if self.domain.is_some() { Domain::Own } else { Domain::Mirror };
        Expected { experiments: self.experiments.as_deref(), domain, declared: &self.declared, errors_alone: false }
    }
}
