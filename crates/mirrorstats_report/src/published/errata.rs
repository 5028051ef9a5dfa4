//! Errata: known errors of a published table, each with both values and a reason.
//!
//! An erratum excuses only the difference that it states: the published and the computed value must both match.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const PAPER: &str = include_str!("../../../../assets/errata/paper.toml");

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

/// The slips of the paper's tables.
pub fn of_paper() -> Vec<Erratum> {
    #[derive(Deserialize)]
    struct Errata {
        erratum: Vec<Erratum>,
    }
    let Errata { erratum } = toml::from_str(PAPER).expect("the built-in errata are well-formed: a test reads them");
    erratum
}

mirrorstats_exact::names!(Field { Mean: "mean", Se: "se", Emphasis: "emphasis" });

#[cfg(test)]
mod tests {
    use super::of_paper;

    #[test]
    fn the_built_in_errata_are_the_two_slips_of_the_paper() {
        let errata = of_paper();
        let named: Vec<String> =
            errata.iter().map(|e| format!("{} {} {} {}", e.table, e.experiment, e.model, e.metric)).collect();
        assert_eq!(named, ["main E3 Gemma4 26B TTD", "main E5 Ministral 3 14B MTATO"]);
        assert!(errata.iter().all(|e| !e.reason.is_empty()));
    }
}
