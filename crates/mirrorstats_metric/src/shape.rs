//! The shape of a definition file, for editors and other programs (`schemas/definitions.schema.json`).
//!
//! Each key is declared once, here: the reader in `file` and the schema both use these types.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::Deserialize;

use super::catalogs::catalog::{Better, Control, Factor, Measures, StandardError, ValueRange};
use super::columns::Type;
use mirrorstats_exact::chance::NoLevel;
use mirrorstats_exact::ratio::Ratio;

/// A definition file.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DefinitionFile {
    /// Definitions to start from: built-in names (`paper`, `extended`) or paths relative to this file.
    #[serde(default)]
    pub include: Vec<String>,
    /// True if experiments that are not listed are accepted. A file that lists none accepts all.
    pub open: Option<bool>,
    /// The subject of the traces: `mirror`, or any other name, for which the mirror's columns have no meaning.
    pub domain: Option<String>,
    /// How other programs' files become such traces; `mirrorstats import` reads it.
    pub import: Option<serde_json::Map<String, serde_json::Value>>,
    /// Columns of your own traces that expressions use.
    #[serde(default)]
    pub column: IndexMap<String, ColumnShape>,
    /// Named expressions.
    #[serde(default, rename = "let")]
    pub lets: IndexMap<String, String>,
    /// Experiments by name.
    #[serde(default)]
    pub experiment: IndexMap<String, ExperimentShape>,
    /// What groups of experiments vary by a number, by name.
    #[serde(default)]
    pub factor: IndexMap<String, Factor>,
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
    pub ty: Type,
    /// True if it is constant in an episode.
    #[serde(default)]
    pub constant: bool,
    /// The only texts that it holds, null apart; any if absent.
    #[serde(default)]
    pub values: Vec<String>,
    /// The unit of a number; a metric of its values has it too.
    #[serde(default)]
    pub unit: String,
    /// On a float: its digits after the point, at most 9. It is rounded to them, and can then be a metric.
    pub decimals: Option<u8>,
    /// For a reader of the column.
    #[serde(default)]
    pub help: String,
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
    /// Chance levels by metric, as fractions such as `1/3`, or one for each strategy such as `{ guessing = "1/3",
    /// disbelieving = "1/2" }`; `none` where a metric's own level does not apply.
    #[serde(default)]
    pub chance: IndexMap<String, ChanceLevel>,
    /// Reference levels by metric, where no chance level applies.
    #[serde(default)]
    pub reference: IndexMap<String, Vec<Fraction>>,
    /// The experiment that this one is the control of, and the metrics to compare.
    pub control: Option<Control>,
}

/// A metric.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MetricShape {
    /// The full name.
    pub title: Option<String>,
    /// The unit; `rate` for 0 or 1 per episode.
    pub unit: Option<String>,
    /// The better direction; neither if absent.
    pub better: Option<Better>,
    /// The section of the paper that defines it.
    #[serde(default)]
    pub section: String,
    /// For a reader of the table.
    #[serde(default)]
    pub help: String,
    /// The SQL expression of an episode's value.
    pub value: String,
    /// The condition for the metric to be defined; defined everywhere if absent.
    pub when: Option<String>,
    /// The standard error of its mean.
    #[serde(default)]
    pub se: StandardError,
    /// The value of blind guessing, as a fraction such as `1/3`.
    pub chance: Option<Fraction>,
    /// The measured quantity; by the unit if absent.
    pub measures: Option<Measures>,
    /// The values that it can have, as integers; on a fraction `most` is the whole.
    pub range: Option<ValueRange>,
    /// On a duration: the metric that is defined in finished episodes, 1 where the decision was correct.
    pub finished: Option<String>,
    /// The rate that counts unfinished episodes as failures; this one is the same among finished ones.
    pub completes: Option<String>,
}

/// A chance level.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[schemars(rename = "Level")]
#[serde(untagged)]
pub enum ChanceLevel {
    /// No level.
    None(NoLevel),
    /// The level.
    Of(Fraction),
    /// The level of each blind strategy, by its name; the highest counts.
    ByStrategy(IndexMap<String, Fraction>),
}

/// A fraction in quotes such as `1/3`, or a number.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Fraction {
    /// In quotes.
    #[schemars(with = "Ratio")]
    Text(String),
    /// A decimal is the fraction that it says: `0.25` is 1/4.
    Number(f64),
}
