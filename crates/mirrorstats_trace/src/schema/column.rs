use arrow::datatypes::DataType;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::field_access::{Access, Value, access};
use crate::diagnostic::Code;
use crate::episodes::answers::{Answered, is_answer};
use crate::episodes::episode::Episode;

#[derive(Clone, Copy, Debug, Serialize)]
#[expect(clippy::struct_excessive_bools, reason = "each is a key of the domain's file")]
pub struct Column {
    pub name: &'static str,
    /// The stored type; readers accept any type of the same [`Kind`].
    #[serde(rename = "type")]
    pub stored: Stored,
    /// True if every trace has the column.
    pub required: bool,
    pub nullable: bool,
    /// True if the value is the same in all rows of an episode.
    pub constant: bool,
    pub unit: Option<&'static str>,
    pub doc: &'static str,
    pub values: &'static [&'static str],
    /// The value if a trace has no such column or a row has no value: an expression in the language of definitions.
    /// `null` means that a missing column equals a column without values, so that definitions may read it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub default: Option<&'static str>,
    #[serde(skip)]
    pub rule: Option<Code>,
    #[serde(skip)]
    pub color: Option<ColorColumn>,
    /// True if it counts something, so that negative numbers are faults.
    #[serde(skip)]
    pub counts: bool,
    #[serde(skip)]
    pub(crate) is_of_some_tasks: bool,
    #[serde(skip)]
    pub(super) is_mark: bool,
    #[serde(skip)]
    pub(super) scope: Scope,
    #[serde(skip)]
    pub(super) access: Access,
}

/// The traces in which a column has the meaning of the schema.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Scope {
    /// Every trace, which must have it.
    Every,
    /// Traces of any domain, if it has the schema's type.
    Any,
    #[default]
    Mirror,
}

/// The colours in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColorColumn {
    pub name: &'static str,
    /// The one of [`WORDS`](super::colors::spelling::WORDS) that the column allows.
    pub word: Option<&'static str>,
    pub(super) advice: &'static str,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stored {
    Bool,
    Int8,
    Int32,
    Int64,
    Float32,
    Float64,
    String,
}

/// The logical type of a column as a reader sees it, whatever its width or encoding in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// True or false.
    Bool,
    /// An integer, read as 64 bits signed.
    Int,
    /// A floating-point number, read as 64 bits.
    Float,
    /// Text.
    String,
    /// Anything else: kept in the file, and of no use to a definition.
    Unsupported,
}

mirrorstats_exact::names!(Kind {
    Bool: "bool",
    Int: "integer",
    Float: "float",
    String: "string",
    Unsupported: "unsupported"
});

mirrorstats_exact::names!(Stored {
    Bool: "bool",
    Int8: "int8",
    Int32: "int32",
    Int64: "int64",
    Float32: "float32",
    Float64: "float64",
    String: "string",
});

impl Kind {
    /// The widest type of its values, as writers and checks hold them.
    pub const fn data_type(self) -> DataType {
        match self {
            Self::Bool => DataType::Boolean,
            Self::Int => DataType::Int64,
            Self::Float => DataType::Float64,
            Self::String => DataType::Utf8,
            Self::Unsupported => DataType::Null,
        }
    }
}

impl Stored {
    pub(crate) const fn data_type(self) -> DataType {
        match self {
            Self::Int8 => DataType::Int8,
            Self::Int32 => DataType::Int32,
            Self::Float32 => DataType::Float32,
            Self::Bool | Self::Int64 | Self::Float64 | Self::String => self.kind().data_type(),
        }
    }

    pub const fn kind(self) -> Kind {
        match self {
            Self::Bool => Kind::Bool,
            Self::Int8 | Self::Int32 | Self::Int64 => Kind::Int,
            Self::Float32 | Self::Float64 => Kind::Float,
            Self::String => Kind::String,
        }
    }

    /// The smallest and largest integer of the type, if it is an integer type.
    pub const fn range(self) -> Option<(i64, i64)> {
        match self {
            Self::Int8 => Some((i8::MIN as i64, i8::MAX as i64)),
            Self::Int32 => Some((i32::MIN as i64, i32::MAX as i64)),
            Self::Int64 => Some((i64::MIN, i64::MAX)),
            Self::Bool | Self::Float32 | Self::Float64 | Self::String => None,
        }
    }
}

impl PartialEq for Column {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Column {}

impl Column {
    /// The meaning of a missing value, if it is a text or a number and not an expression over other columns.
    pub fn default_text(&self) -> Option<&'static str> {
        let text = self.default?;
        let quoted = text.strip_prefix('\'').and_then(|text| text.strip_suffix('\''));
        quoted.or_else(|| text.bytes().all(|byte| byte.is_ascii_digit()).then_some(text))
    }

    pub(crate) fn of_answer(name: &'static str, stored: Stored) -> Self {
        Self {
            name,
            stored,
            required: false,
            nullable: true,
            constant: false,
            unit: None,
            doc: "An answer that the experiment declares, or what it should be.",
            values: &[],
            default: None,
            rule: None,
            color: None,
            counts: false,
            is_of_some_tasks: false,
            is_mark: false,
            scope: Scope::Any,
            access: access(name),
        }
    }

    /// The values of all steps; `None` for null.
    pub fn of_steps<'a>(&self, episode: &'a Episode) -> impl Iterator<Item = Option<Value<'a>>> {
        let (get, answer) = (self.access.get, is_answer(self.name).then_some(self.name));
        (0..episode.steps.len()).map(move |at| match answer {
            Some(name) => episode.steps[at].extra.answers.get(name).map(Answered::value),
            None => get(episode, at),
        })
    }

    /// Sets the value at a step index; returns false and changes nothing if the field cannot hold it.
    pub(crate) fn put(&self, episode: &mut Episode, at: usize, value: Option<Value<'_>>) -> bool {
        (self.access.set)(episode, at, value)
    }
}
