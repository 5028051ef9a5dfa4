//! The column names that expressions may use, with type and level; independent of files.

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The type of an expression. Integers are 64-bit, floats IEEE doubles whose NaN equals itself and exceeds every number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Type {
    /// True, false or null.
    Bool,
    /// A 64-bit integer or null.
    Int,
    /// A double or null.
    Float,
    /// Text or null; ordered by its UTF-8 bytes.
    Text,
}

impl Type {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "true or false",
            Self::Int => "an integer",
            Self::Float => "a float",
            Self::Text => "text",
        }
    }
}

/// How often an expression has a value. Ordered by spreading: one value per episode can serve as one value per step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    Constant,
    Episode,
    Step,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    pub ty: Type,
    /// [`Level::Episode`] if the schema declares it constant in an episode.
    pub level: Level,
}

/// The columns by name: those of the schema in its order, then other columns of some traces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Columns {
    known: IndexMap<String, KnownColumn>,
    help: Option<&'static str>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownColumn {
    pub column: Column,
    pub origin: ColumnOrigin,
    /// The only values, except null; any if empty.
    pub values: Vec<String>,
    /// The value in traces or rows that have none, if that is not null.
    pub fallback: Option<Fallback>,
    /// The digits after the point that a float is rounded to, so that it can be a metric; it stays a float if absent.
    pub decimals: Option<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnOrigin {
    /// The meaning is the same in every trace.
    Schema,
    /// The same, but only in the domain of the mirror.
    Mirror,
    /// A column of some traces.
    Own,
    /// A column that holds only nulls in the traces: it fits any declared type, and is text otherwise.
    OnlyNulls,
}

/// The value of a schema column if a trace or row has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fallback {
    pub expression: &'static str,
    /// True if some trace has the column.
    pub is_read: bool,
}

impl KnownColumn {
    pub const fn new(column: Column, origin: ColumnOrigin) -> Self {
        Self { column, origin, values: Vec::new(), fallback: None, decimals: None }
    }

    pub(crate) const fn is_of_schema(&self) -> bool {
        matches!(self.origin, ColumnOrigin::Schema | ColumnOrigin::Mirror)
    }
}

impl Columns {
    /// The same columns; `help` is the advice for a name without similar ones.
    #[must_use]
    pub fn with_help(self, help: &'static str) -> Self {
        Self { help: Some(help), ..self }
    }

    pub(crate) fn help(&self) -> &'static str {
        self.help.unwrap_or("a column of your own is declared with [column.NAME] and `type`")
    }

    /// Removes the meaning of the mirror's columns: their names are free, and unknown unless the traces have own
    /// columns of these names.
    pub(crate) fn leave_mirror(&mut self) {
        self.known.retain(|_, known| known.origin != ColumnOrigin::Mirror);
    }

    pub fn known(&self, name: &str) -> Option<&KnownColumn> {
        self.known.get(name)
    }

    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.known.keys().map(String::as_str)
    }

    /// Adds a column or replaces it. A column of the schema is not replaced.
    pub fn add(&mut self, name: impl Into<String>, column: KnownColumn) {
        let name = name.into();
        if !self.known.get(&name).is_some_and(KnownColumn::is_of_schema) {
            self.known.insert(name, column);
        }
    }

    /// Sets the decimals of a known column; nothing happens to an unknown one.
    pub(crate) fn set_decimals(&mut self, name: &str, decimals: Option<u8>) {
        if let Some(known) = self.known.get_mut(name) {
            known.decimals = decimals;
        }
    }
}

impl<N: Into<String>> FromIterator<(N, KnownColumn)> for Columns {
    fn from_iter<I: IntoIterator<Item = (N, KnownColumn)>>(columns: I) -> Self {
        let known = columns.into_iter().map(|(name, column)| (name.into(), column)).collect();
        Self { known, help: None }
    }
}

impl<N: Into<String>> FromIterator<(N, Column)> for Columns {
    fn from_iter<I: IntoIterator<Item = (N, Column)>>(columns: I) -> Self {
        columns.into_iter().map(|(name, column)| (name, KnownColumn::new(column, ColumnOrigin::Schema))).collect()
    }
}
