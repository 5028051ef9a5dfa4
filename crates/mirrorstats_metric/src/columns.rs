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
    schema: IndexMap<String, Column>,
    own: IndexMap<String, Column>,
    fallbacks: IndexMap<String, Fallback>,
    values: IndexMap<String, Vec<String>>,
    /// Columns of the schema that have a meaning only in the domain of the mirror.
    of_mirror: Vec<String>,
    /// Columns that hold only nulls in the traces, of no type.
    null: Vec<String>,
    stranger: Option<&'static str>,
}

/// The value of a schema column if a trace or row has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fallback {
    pub expression: &'static str,
    /// True if some trace has the column.
    pub is_read: bool,
}

impl Columns {
    /// The same columns; `help` is the advice for a name without similar ones.
    #[must_use]
    pub fn with_help(self, help: &'static str) -> Self {
        Self { stranger: Some(help), ..self }
    }

    /// The same columns; these of the schema take only the listed values or null.
    #[must_use]
    pub fn with_values<N: Into<String>>(self, lists: impl IntoIterator<Item = (N, &'static [&'static str])>) -> Self {
        let owned = |values: &[&str]| values.iter().map(|value| (*value).to_owned()).collect();
        let values = lists.into_iter().map(|(name, values)| (name.into(), owned(values))).collect();
        Self { values, ..self }
    }

    /// The same columns; these of the schema have a meaning only in the domain of the mirror.
    #[must_use]
    pub fn with_mirror<N: Into<String>>(self, names: impl IntoIterator<Item = N>) -> Self {
        Self { of_mirror: names.into_iter().map(Into::into).collect(), ..self }
    }

    /// Removes the meaning of the mirror's columns: their names are free, and unknown unless the traces have own
    /// columns of these names.
    pub(crate) fn leave_mirror(&mut self) {
        for name in std::mem::take(&mut self.of_mirror) {
            self.forget(&name);
        }
    }

    /// The only values of a column, except null; `None` if any are possible.
    pub fn values(&self, name: &str) -> Option<&[String]> {
        self.values.get(name).map(Vec::as_slice)
    }

    pub fn help(&self) -> &'static str {
        self.stranger.unwrap_or("a column of your own is declared with [column.NAME] and `type`")
    }

    pub fn get(&self, name: &str) -> Option<Column> {
        self.schema.get(name).or_else(|| self.own.get(name)).copied()
    }

    /// The schema's column of this name, with the same meaning in every trace.
    pub(crate) fn of_schema(&self, name: &str) -> Option<Column> {
        self.schema.get(name).copied()
    }

    pub(crate) fn is_reserved(&self, name: &str) -> bool {
        self.schema.contains_key(name)
    }

    /// Removes a column from the schema: these traces use its name for something else.
    pub fn forget(&mut self, name: &str) {
        self.schema.shift_remove(name);
        self.values.shift_remove(name);
    }

    /// The value of the column in rows that have none; `None` if that is null.
    pub(crate) fn fallback_of(&self, name: &str) -> Option<Fallback> {
        self.fallbacks.get(name).copied().filter(|_| self.schema.contains_key(name))
    }

    /// Sets the value of a column of the schema in rows that have none.
    pub fn set_fallback(&mut self, name: impl Into<String>, fallback: Fallback) {
        self.fallbacks.insert(name.into(), fallback);
    }

    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.schema.keys().chain(self.own.keys()).map(String::as_str)
    }

    /// Adds a column with the same meaning for every reader of these traces, like those of the schema.
    pub fn add_known(&mut self, name: impl Into<String>, column: Column) {
        self.schema.insert(name.into(), column);
    }

    /// Sets the type and level of a column outside the schema; columns of the schema stay unchanged.
    pub fn set_own(&mut self, name: impl Into<String>, column: Column) {
        let name = name.into();
        if !self.schema.contains_key(&name) {
            self.own.insert(name, column);
        }
    }

    /// Sets a column outside the schema that holds only nulls: it fits any declared type, and is text otherwise.
    pub fn set_null(&mut self, name: &str) {
        self.set_own(name, Column { ty: Type::Text, level: Level::Step });
        self.null.push(name.to_owned());
    }

    pub(crate) fn is_null(&self, name: &str) -> bool {
        self.null.iter().any(|null| null == name)
    }

    pub(crate) fn set_own_values(&mut self, name: &str, values: &[String]) {
        if self.own.contains_key(name) && !values.is_empty() {
            self.values.insert(name.to_owned(), values.to_vec());
        }
    }
}

impl<N: Into<String>> FromIterator<(N, Column)> for Columns {
    fn from_iter<I: IntoIterator<Item = (N, Column)>>(columns: I) -> Self {
        let schema = columns.into_iter().map(|(name, column)| (name.into(), column)).collect();
        Self { schema, ..Self::default() }
    }
}
