//! Domains: the columns of the schema with a meaning in a trace.
//!
//! Every domain has identity and time. In other domains, the names of the mirror's columns have no special meaning.

use std::sync::LazyLock;

use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::Value;

use super::column::{ColorColumn, Column, Kind, Scope, Stored};
use super::field_access::access;
use crate::diagnostic::Code;

/// The subject of a trace's episodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Domain {
    /// Embodied agents before a mirror: the whole schema applies.
    #[default]
    Mirror,
    /// Anything else: identity and time, and the file's own columns.
    Own,
}

pub(crate) const MIRROR: &str = "mirror";

/// The columns of the schema, in storage order: required ones first.
pub static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
    let text = include_str!("../../../../assets/domains/mirror.toml");
    let file: DomainFile = toml::from_str(text).expect("the built-in domain is well-formed: a test reads it");
    let DomainFile { counted, column } = file;
    column.into_iter().map(|(name, declared)| declared.named(name.leak(), &counted)).collect()
});

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DomainFile {
    counted: Vec<String>,
    column: IndexMap<String, DomainColumn>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(clippy::struct_excessive_bools, reason = "each is a key of the file")]
struct DomainColumn {
    #[serde(rename = "type")]
    stored: Stored,
    #[serde(rename = "in", default)]
    scope: Scope,
    #[serde(default)]
    required: bool,
    nullable: Option<bool>,
    #[serde(default)]
    constant: bool,
    #[serde(default)]
    mark: bool,
    #[serde(default)]
    task: bool,
    unit: Option<String>,
    default: Option<String>,
    #[serde(default)]
    values: Vec<String>,
    rule: Option<Code>,
    color: Option<DomainColor>,
    help: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DomainColor {
    word: Option<String>,
    advice: String,
}

impl DomainColumn {
    /// The column. Its texts are kept until the process ends, since there is only one table.
    fn named(self, name: &'static str, counted: &[String]) -> Column {
        let kept = |text: String| &*text.leak();
        let color = |color: DomainColor| ColorColumn { name, word: color.word.map(kept), advice: kept(color.advice) };
        Column {
            name,
            stored: self.stored,
            required: self.required,
            nullable: self.nullable.unwrap_or(!self.required),
            constant: self.constant,
            counts: self.unit.as_ref().is_some_and(|unit| counted.contains(unit)),
            unit: self.unit.map(kept),
            doc: kept(self.help),
            values: self.values.into_iter().map(kept).collect::<Vec<&str>>().leak(),
            default: self.default.map(kept),
            rule: self.rule,
            color: self.color.map(color),
            is_of_some_tasks: self.task,
            is_mark: self.mark,
            scope: self.scope,
            access: access(name),
        }
    }
}

impl Domain {
    /// The domain of a file: the recording names it. Otherwise a file with an identity and no column of the mirror has
    /// its own domain; all others, damaged ones included, are traces of the mirror.
    pub(crate) fn of_file(has: impl Fn(&str) -> bool, recording: &Value) -> Self {
        if let Some(name) = recording["domain"].as_str() {
            return Self::named(name);
        }
        let is_lacking = |known: &Column| known.scope == Scope::Every && !has(known.name);
        let is_about = |known: &Column| known.is_mark && has(known.name);
        if COLUMNS.iter().any(|known| is_lacking(known) || is_about(known)) { Self::Mirror } else { Self::Own }
    }

    pub fn named(name: &str) -> Self {
        if name == MIRROR { Self::Mirror } else { Self::Own }
    }

    pub fn has(self, column: &Column) -> bool {
        self == Self::Mirror || column.scope != Scope::Mirror
    }

    pub fn column(self, name: &str) -> Option<&'static Column> {
        column(name).filter(|column| self.has(column))
    }
}

pub fn column(name: &str) -> Option<&'static Column> {
    COLUMNS.iter().find(|column| column.name == name)
}

/// A column that definitions of another domain declare.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeclaredColumn {
    pub name: String,
    pub kind: Kind,
    /// The only texts in it, except null; any if empty.
    pub values: Vec<String>,
    pub constant: bool,
}

/// Returns true if every trace has the column, whatever its domain.
pub fn is_identity(name: &str) -> bool {
    column(name).is_some_and(|column| column.scope == Scope::Every)
}

/// Returns true if a column of the schema belongs to every domain.
pub fn is_general(name: &str) -> bool {
    column(name).is_some_and(|column| column.scope != Scope::Mirror)
}
