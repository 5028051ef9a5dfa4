//! The schema as a document, printed by `mirrorstats trace schema` and stored in `schemas/trace.schema.json`.

use serde::Serialize;

use crate::diagnostic::{Code, Severity};
use crate::schema::{COLUMNS, Column, METADATA, MetadataKey, SCHEMA_VERSION};

#[derive(Clone, Debug, Serialize)]
pub struct SchemaDocument {
    pub title: &'static str,
    pub description: &'static str,
    pub version: u32,
    pub columns: &'static [Column],
    pub metadata: &'static [MetadataKey],
    pub rules: Vec<RuleDescription>,
}

#[derive(Clone, Copy, Debug, Serialize)]
pub struct RuleDescription {
    pub code: Code,
    /// True if breaking it makes a trace unusable.
    pub severity: Severity,
    pub rule: &'static str,
    pub help: &'static str,
}

impl SchemaDocument {
    pub fn current() -> Self {
        let rule =
            |code: Code| RuleDescription { code, severity: code.severity(), rule: code.explain(), help: code.help() };
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
