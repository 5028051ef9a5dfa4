//! The schema as a document, printed by `mirrorstats trace schema` and stored in `schemas/trace.schema.json`.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::diagnostic::{Code, Severity};
use crate::schema::{COLUMNS, Column, SCHEMA_VERSION};

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetadataKey {
    pub key: String,
    pub doc: String,
}

#[derive(Deserialize)]
struct MetadataFile {
    metadata: Vec<MetadataKey>,
}

static METADATA: LazyLock<MetadataFile> = LazyLock::new(|| {
    let text = include_str!("../../../../assets/trace/metadata.toml");
    toml::from_str(text).expect("the built-in keys are well-formed: a test reads them")
});

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
            metadata: &METADATA.metadata,
            rules: Code::ALL.into_iter().map(rule).collect(),
        }
    }
}
