//! Domains: the columns of the schema with a meaning in a trace.
//!
//! Every domain has identity and time. In other domains, the names of the mirror's columns have no special meaning.

use std::sync::LazyLock;

use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::Value;

use super::column::{Column, Kind, Scope};

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
    file.column.into_iter().map(|(name, column)| column.named(name.leak(), &file.counted)).collect()
});

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DomainFile {
    counted: Vec<String>,
    column: IndexMap<String, Column>,
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

pub fn is_identity(name: &str) -> bool {
    column(name).is_some_and(|column| column.scope == Scope::Every)
}

pub fn is_general(name: &str) -> bool {
    column(name).is_some_and(|column| column.scope != Scope::Mirror)
}
