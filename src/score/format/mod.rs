//! The episode table as bytes and back: Parquet, CSV, JSON lines.
//!
//! Columns are `episode_id, model, experiment, seed, run`, then the labels, then the metrics by name;
//! rates are 0 and 1; undefined is null or empty. Parquet carries the definitions in its footer; the
//! two text formats cannot, so whoever reads them back names the definitions.

mod csv;
mod jsonl;
mod parquet;

use std::io::{Read, Write};

use super::table::EpisodeTable;
use crate::metric::catalog::Catalog;

pub use self::parquet::{DEFINITIONS_KEY, HASH_KEY, KIND_KEY, SCORES_KIND, is_scores, read as read_parquet};

/// A format of episode tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Columnar, with the definitions in its footer.
    Parquet,
    /// Comma-separated, with a header.
    Csv,
    /// A JSON object a line.
    JsonLines,
}

impl Format {
    /// The format that a file name's ending asks for.
    ///
    /// # Errors
    /// An ending that is none of the three.
    pub fn of_name(name: &str) -> Result<Self, FormatError> {
        match name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase()).as_deref() {
            Some("parquet") => Ok(Self::Parquet),
            Some("csv") => Ok(Self::Csv),
            Some("jsonl" | "ndjson") => Ok(Self::JsonLines),
            _ => Err(FormatError::Ending(name.to_owned())),
        }
    }
}

/// What keeps an episode table from being written or read.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// A file name that asks for no known format.
    #[error("`{0}`: expected a name that ends in .parquet, .csv or .jsonl")]
    Ending(String),
    /// Bytes could not be written or read.
    #[error("cannot write or read the scores")]
    Io(#[from] std::io::Error),
    /// The Parquet library's own words.
    #[error("not a readable Parquet file of scores: {0}")]
    Parquet(#[from] ::parquet::errors::ParquetError),
    /// A column that is missing or has another type.
    #[error("column `{column}`: expected {expected}, found {found}; scores are written by `mirrorstats score`")]
    Column {
        /// Its name.
        column: String,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A value that is not what its column holds.
    #[error("line {line}, column `{column}`: expected {expected}, found `{found}`")]
    Value {
        /// 1-based.
        line: usize,
        /// Its name.
        column: String,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A line that is no CSV or JSON.
    #[error("line {line}: {reason}")]
    Line {
        /// 1-based.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// The definitions in the footer.
    #[error("the definitions in the footer are not readable: {0}")]
    Definitions(String),
}

/// Writes a table.
///
/// # Errors
/// Whatever writing gives.
pub fn write(table: &EpisodeTable, format: Format, out: impl Write + Send) -> Result<(), FormatError> {
    match format {
        Format::Parquet => parquet::write(table, out),
        Format::Csv => csv::write(table, out),
        Format::JsonLines => jsonl::write(table, out),
    }
}

/// Reads a table of one of the text formats; `catalog` tells which columns are metrics.
///
/// # Errors
/// The first line that is not as it must be.
pub fn read_text(format: Format, catalog: &Catalog, input: impl Read) -> Result<EpisodeTable, FormatError> {
    match format {
        Format::JsonLines => jsonl::read(catalog, input),
        Format::Csv | Format::Parquet => csv::read(catalog, input),
    }
}
