//! The shape of a definition file, for editors and other programs (`schemas/definitions.schema.json`).
//!
//! The reader in `file` goes by the TOML itself, to show every fault at its place; this is the same
//! shape as types. A test reads the built-in files through both.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Deserialize;

use super::catalog::{Better, Measures, StandardError, ValueRange};
use exact::ratio::Ratio;

/// A definition file.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DefinitionFile {
    /// Definitions to start from: built-in names (`paper`, `extended`) or paths relative to this file.
    #[serde(default)]
    pub include: Vec<String>,
    /// Whether experiments that are not listed are accepted. A file that lists none accepts all.
    #[serde(default)]
    pub open: bool,
    /// What the traces are about: `mirror`, or any other name, where the columns of the mirror mean nothing.
    pub domain: Option<String>,
    /// Columns of your own traces that expressions use.
    #[serde(default)]
    pub column: IndexMap<String, ColumnShape>,
    /// Named expressions.
    #[serde(default, rename = "let")]
    pub lets: IndexMap<String, String>,
    /// Experiments by name.
    #[serde(default)]
    pub experiment: IndexMap<String, ExperimentShape>,
    /// Metrics by name.
    #[serde(default)]
    pub metric: IndexMap<String, MetricShape>,
}

/// A column of your own.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ColumnShape {
    /// The type of its values.
    #[serde(rename = "type")]
    pub ty: TypeShape,
    /// Whether it is constant in an episode.
    #[serde(default)]
    pub constant: bool,
    /// The only texts that it holds, null apart; any if absent.
    #[serde(default)]
    pub values: Vec<String>,
    /// What a number counts or measures.
    #[serde(default)]
    pub unit: String,
    /// For a reader of the column.
    #[serde(default)]
    pub help: String,
}

/// The type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "the names say it")]
pub enum TypeShape {
    Bool,
    Int,
    Float,
    Text,
}

/// An experiment.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExperimentShape {
    /// The heading of its group in tables.
    #[serde(default)]
    pub title: String,
    /// Its position among the experiments.
    pub order: Option<i64>,
    /// Chance levels by metric, as fractions such as `1/3`; `none` where a metric's own level does not apply.
    #[serde(default)]
    pub chance: IndexMap<String, String>,
    /// Reference levels by metric, where no chance level applies.
    #[serde(default)]
    pub reference: IndexMap<String, Vec<Ratio>>,
}

/// A metric.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MetricShape {
    /// The full name.
    pub title: Option<String>,
    /// What is counted; `rate` for 0 or 1 an episode.
    pub unit: Option<String>,
    /// Which direction is better; neither if absent.
    pub better: Option<Better>,
    /// The section of the paper that defines it.
    #[serde(default)]
    pub section: String,
    /// For a reader of the table.
    #[serde(default)]
    pub help: String,
    /// The SQL expression of an episode's value.
    pub value: String,
    /// Where the metric is defined; everywhere if absent.
    pub when: Option<String>,
    /// Which standard error goes with its mean.
    #[serde(default)]
    pub se: StandardError,
    /// The value of blind guessing, as a fraction such as `1/3`.
    pub chance: Option<Ratio>,
    /// What the metric measures; as its unit says if absent.
    pub measures: Option<Measures>,
    /// The values that it can have, as integers; on a fraction `most` is the whole.
    pub range: Option<ValueRange>,
    /// On a duration: the metric that is defined in finished episodes, 1 where the decision was correct.
    pub finished: Option<String>,
    /// The rate that counts unfinished episodes as failures; this one is the same among finished ones.
    pub completes: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::DefinitionFile;
    use crate::file::{built_in, built_in_names, read};

    #[test]
    fn the_built_in_files_have_this_shape() {
        for name in built_in_names() {
            let shape: DefinitionFile = toml::from_str(built_in(name).unwrap()).unwrap();
            let document = read(name).unwrap();
            assert!(!shape.metric.is_empty());
            for (metric, entry) in &shape.metric {
                assert_eq!(entry.value, document.metrics[metric].value.text);
            }
        }
    }
}
