//! Writes and reads the episode table: Parquet, CSV, JSON lines.
//!
//! Columns are `episode_id, model, experiment, seed, run`, then the labels, then the metrics by name; rates are 0 and
//! 1; undefined is null or empty. Parquet has the definitions and the traces' declarations in its footer. The text
//! formats have the declarations in a last column, on the first row; their reader supplies the definitions. So does the
//! reader of a table that another engine's SQL computed.

mod csv;
mod footer;
mod jsonl;
pub mod parquet;
mod partition;

use std::collections::{BTreeMap, HashSet};
use std::io::{self, Read, Write};

use ::parquet::errors::ParquetError;
use serde::{Deserialize, Serialize};

use super::tables::table::{Declared, EpisodeTable};
use mirrorstats_metric::catalogs::catalog::{Catalog, Experiment, Kind};
use mirrorstats_trace::read::flat::TableFile;

pub(crate) use self::parquet::DECLARED_KEY;
pub use self::parquet::{DEFINITIONS_KEY, HASH_KEY, KIND_KEY, SCORES_KIND, holds_definitions, holds_scores};
pub use self::partition::Partition;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Parquet,
    Csv,
    JsonLines,
}

impl Format {
    pub fn of_name(name: &str) -> Result<Self, FormatError> {
        match name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase()).as_deref() {
            Some("parquet") => Ok(Self::Parquet),
            Some("csv") => Ok(Self::Csv),
            Some("jsonl" | "ndjson") => Ok(Self::JsonLines),
            _ => Err(FormatError::Ending(name.to_owned())),
        }
    }
}

#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    #[error("`{0}`: expected a name that ends in .parquet, .csv or .jsonl")]
    Ending(String),
    #[error("cannot write or read the scores")]
    Io(#[from] std::io::Error),
    #[error("not a readable Parquet file of scores: {0}")]
    Parquet(#[from] ::parquet::errors::ParquetError),
    #[error("the file is damaged: {0}; restore it from its source, or score the traces again")]
    Damaged(String),
    #[error("column `{column}`: expected {expected}, found {found}; scores are written by `mirrorstats score`")]
    Column { column: String, expected: &'static str, found: String },
    #[error("line {line}, column `{column}`: expected {expected}, found `{found}`")]
    Value { line: usize, column: String, expected: &'static str, found: String },
    #[error("episode `{episode}`, column `{column}`: expected {expected}, found {found}; score the traces again")]
    Episode { episode: String, column: String, expected: String, found: String },
    #[error(
        "expected scores with one row per episode, found steps (a column `t` exists)\n  \
         help: make a trace first: `mirrorstats import` reads JSON Lines, `import_steps` in Python a data frame"
    )]
    Steps,
    #[error("line {line}: {reason}")]
    Line { line: usize, reason: String },
    #[error("`{DECLARED_KEY}` is not readable: {0}; score the traces again")]
    Declared(String),
    #[error("the definitions in the footer are not readable: {0}")]
    Definitions(String),
}

impl FormatError {
    fn column(column: &str, expected: &'static str, found: impl Into<String>) -> Self {
        Self::Column { column: column.to_owned(), expected, found: found.into() }
    }

    /// The system's error, if there is one: usually a full disk or a closed pipe.
    pub fn into_io(self) -> Result<io::Error, Self> {
        match self {
            Self::Io(error) => Ok(error),
            Self::Parquet(ParquetError::External(error)) => match error.downcast::<io::Error>() {
                Ok(error) => Ok(*error),
                Err(error) => Err(Self::Parquet(ParquetError::External(error))),
            },
            other => Err(other),
        }
    }
}

/// Writes a table. Several threads can encode Parquet: see [`parquet::Encoder`].
pub fn write(table: &EpisodeTable, format: Format, out: impl Write + Send) -> Result<(), FormatError> {
    match format {
        Format::Parquet => {
            let (encoder, mut writer) = parquet::encoder(table, out)?;
            encoder.jobs().try_for_each(|job| writer.append(encoder.encode(job)?))?;
            writer.finish()
        }
        Format::Csv => csv::write(table, out),
        Format::JsonLines => jsonl::write(table, out),
    }
}

/// Reads a table in one of the text formats; `catalog` says which columns are metrics.
pub fn read_text(format: Format, catalog: &Catalog, input: impl Read) -> Result<EpisodeTable, FormatError> {
    checked(match format {
        Format::JsonLines => jsonl::read(catalog, input)?,
        Format::Csv | Format::Parquet => csv::read(catalog, input)?,
    })
}

pub fn read_parquet(input: TableFile, partition: &Partition<'_>) -> Result<EpisodeTable, FormatError> {
    checked(parquet::read(input, partition)?)
}

/// The traces' declarations, as one JSON text; in Parquet the definitions already have the experiments.
#[derive(Default, PartialEq, Serialize, Deserialize)]
struct DeclaredText {
    #[serde(flatten)]
    declared: Declared,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    experiments: BTreeMap<String, Experiment>,
}

impl DeclaredText {
    /// The text of a table in CSV or JSON Lines, without the hashes of steps; `None` if the traces declare nothing.
    fn of_table(table: &EpisodeTable) -> Result<Option<String>, FormatError> {
        let declared = Declared { steps: BTreeMap::new(), ..table.declared.clone() };
        Self { declared, experiments: table.catalog.declared().collect() }.text()
    }

    fn text(&self) -> Result<Option<String>, FormatError> {
        let text = || serde_json::to_string(self).map_err(|error| FormatError::Declared(error.to_string()));
        (*self != Self::default()).then(text).transpose()
    }

    fn parse(text: &str) -> Result<Self, FormatError> {
        serde_json::from_str(text).map_err(|error| FormatError::Declared(error.to_string()))
    }
}

/// Checks that a table is one that scoring can give: unique episodes, known experiments, rates 0 and 1.
fn checked(table: EpisodeTable) -> Result<EpisodeTable, FormatError> {
    let fault = |row: usize, column: &str, expected: &str, found: &str| FormatError::Episode {
        episode: table.keys.get(row).episode_id.to_owned(),
        column: column.to_owned(),
        expected: expected.to_owned(),
        found: found.to_owned(),
    };
    let experiments = &table.catalog.experiment;
    let mut seen = HashSet::new();
    for (row, key) in table.keys.iter().enumerate() {
        if !seen.insert(key.episode_id) {
            return Err(fault(row, "episode_id", "each episode once", "a second row of it"));
        }
        if !table.catalog.open && !experiments.contains_key(key.experiment) {
            let known = experiments.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
            return Err(fault(row, "experiment", &format!("one of {known}"), &format!("`{}`", key.experiment)));
        }
    }
    for metric in &table.metrics {
        let is_rate = table.catalog.metric.get(&metric.name).is_some_and(|known| known.kind == Kind::Rate);
        let strange = |value: Option<i64>| is_rate && !matches!(value, None | Some(0 | 1));
        if let Some(row) = metric.iter().position(strange) {
            let found = metric.get(row).map_or_else(String::new, |value| value.to_string());
            return Err(fault(row, &metric.name, "0 or 1, or nothing where it is undefined", &found));
        }
    }
    Ok(table)
}
