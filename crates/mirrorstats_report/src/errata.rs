//! Errata: known errors of a published table, each with both values and a reason.
//!
//! An erratum excuses only the difference that it states: the published and the computed value must both match. The
//! paper's errata are built in.

use std::io;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::published::CellLabel;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_toml_spec::{Faults, Source};

const PAPER: &str = include_str!("../../../assets/errata/paper.toml");

/// An errata file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Errata {
    /// The slips.
    #[serde(default)]
    pub erratum: Vec<Erratum>,
}

/// One slip.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Erratum {
    /// The table, `main` or `appendix` in the paper.
    pub table: String,
    /// The experiment of the cell.
    pub experiment: String,
    /// The model of the cell.
    pub model: String,
    /// The metric of the cell.
    pub metric: String,
    /// The field of the cell.
    pub field: Field,
    /// The published text; empty for undefined and for no emphasis.
    pub published: String,
    /// The text that follows from the data.
    pub computed: String,
    /// The reason why the difference is the publication's.
    pub reason: String,
}

/// A part of a printed cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Field {
    /// The mean.
    Mean,
    /// The standard error.
    Se,
    /// Its emphasis.
    Emphasis,
}

#[derive(Debug, thiserror::Error)]
pub enum ErrataError {
    #[error("errata {}: cannot read the file: {source}", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Faults(#[from] Faults),
}

/// An erratum takes about a hundred bytes.
const LARGEST: Limit = Limit::new("bytes of errata", 1 << 20);

impl Errata {
    pub fn of_paper() -> Self {
        toml::from_str(PAPER).expect("the built-in errata are well-formed: a test reads them")
    }

    pub fn read(path: &Path) -> Result<Self, ErrataError> {
        let text =
            input::text(path, LARGEST).map_err(|source| ErrataError::Unreadable { path: path.to_owned(), source })?;
        let source = Source { name: path.display().to_string(), text };
        Ok(mirrorstats_toml_spec::read_source(source, "a list of errata", |errata: &Self, at, faults| {
            for (n, erratum) in errata.erratum.iter().enumerate() {
                let reason = at.key("erratum").item(n).get("reason").filter(|_| erratum.reason.trim().is_empty());
                let fault = reason.map(|reason| reason.fault("expected a reason, found none"));
                faults.extend(fault.map(|fault| fault.help("say why the publication errs")));
            }
        })?)
    }
}

impl Erratum {
    pub fn is_about(&self, table: &str, cell: &CellLabel) -> bool {
        let CellLabel { experiment, model, metric } = cell;
        (self.table.as_str(), &self.experiment, &self.model, &self.metric) == (table, experiment, model, metric)
    }
}

mirrorstats_exact::names!(Field { Mean: "mean", Se: "se", Emphasis: "emphasis" });

#[cfg(test)]
mod tests {
    use super::Errata;

    #[test]
    fn the_built_in_errata_are_the_two_slips_of_the_paper() {
        let errata = Errata::of_paper().erratum;
        let named: Vec<String> =
            errata.iter().map(|e| format!("{} {} {} {}", e.table, e.experiment, e.model, e.metric)).collect();
        assert_eq!(named, ["main E3 Gemma4 26B TTD", "main E5 Ministral 3 14B MTATO"]);
        assert!(errata.iter().all(|e| !e.reason.is_empty()));
    }
}
