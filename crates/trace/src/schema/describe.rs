//! The schema as a document, printed by `mirrorstats trace schema` and stored in `schemas/trace.schema.json`.

use serde::Serialize;

use crate::diagnostic::{Code, Severity};
use crate::schema::{COLUMNS, Column, METADATA, MetadataKey, SCHEMA_VERSION};

/// Everything that writers and readers of traces must know.
#[derive(Clone, Debug, Serialize)]
pub struct SchemaDocument {
    pub title: &'static str,
    /// The format, in a few sentences.
    pub description: &'static str,
    /// The version of the schema.
    pub version: u32,
    /// The columns, required ones first.
    pub columns: &'static [Column],
    /// The key-value metadata of the footer.
    pub metadata: &'static [MetadataKey],
    /// The rules that `mirrorstats trace validate` checks.
    pub rules: Vec<Rule>,
}

/// One rule and the code of its findings.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Rule {
    pub code: Code,
    /// True if breaking it makes a trace unusable.
    pub severity: Severity,
    pub rule: &'static str,
    pub help: &'static str,
}

impl SchemaDocument {
    /// The schema of this program.
    pub fn current() -> Self {
        let rule = |code: Code| Rule { code, severity: code.severity(), rule: code.explain(), help: code.help() };
        Self {
            title: "mirrorstats trace",
            description: "A Parquet file of whole episodes: the rows of an episode are together, and t runs 1..T. \
                          Readers take plain and dictionary strings, and integers of any width. \
                          Columns that are not listed are kept and can be used in definitions.",
            version: SCHEMA_VERSION,
            columns: &COLUMNS,
            metadata: METADATA,
            rules: Code::ALL.into_iter().map(rule).collect(),
        }
    }
}
