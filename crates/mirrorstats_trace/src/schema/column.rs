use arrow::datatypes::DataType;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::diagnostic::Code;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(clippy::struct_excessive_bools, reason = "each is a key of the domain's file")]
pub struct Column {
    #[serde(skip_deserializing)]
    pub name: Text,
    /// The stored type; readers accept any type of the same [`Kind`].
    #[serde(rename = "type")]
    pub stored: Stored,
    /// True if every trace has the column.
    #[serde(default)]
    pub required: bool,
    #[serde(default)]
    pub nullable: bool,
    /// True if the value is the same in all rows of an episode.
    #[serde(default)]
    pub constant: bool,
    #[serde(default, deserialize_with = "optional_text")]
    pub unit: Option<Text>,
    #[serde(rename(deserialize = "help"), deserialize_with = "text")]
    pub doc: Text,
    #[serde(default, deserialize_with = "texts")]
    pub values: &'static [&'static str],
    /// The value if a trace has no such column or a row has no value: an expression in the language of definitions.
    /// `null` means that a missing column equals a column without values, so that definitions may read it.
    #[serde(default, deserialize_with = "optional_text", skip_serializing_if = "Option::is_none")]
    pub default: Option<Text>,
    #[serde(skip_serializing)]
    pub rule: Option<Code>,
    #[serde(skip_serializing)]
    pub color: Option<ColorColumn>,
    /// True if it counts something, so that negative numbers are faults.
    #[serde(skip)]
    pub counts: bool,
    #[serde(rename(deserialize = "task"), default, skip_serializing)]
    pub is_of_some_tasks: bool,
    #[serde(rename(deserialize = "mark"), default, skip_serializing)]
    pub(crate) is_mark: bool,
    #[serde(rename(deserialize = "in"), default, skip_serializing)]
    pub(crate) scope: Scope,
}

/// A text that is kept until the process ends, since there is only one table of columns. The alias keeps Serde from
/// borrowing it.
type Text = &'static str;

fn text<'de, D: Deserializer<'de>>(from: D) -> Result<Text, D::Error> {
    String::deserialize(from).map(|text| &*text.leak())
}

fn optional_text<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Text>, D::Error> {
    text(from).map(Some)
}

fn texts<'de, D: Deserializer<'de>>(from: D) -> Result<&'static [Text], D::Error> {
    let texts = Vec::<String>::deserialize(from)?;
    Ok(texts.into_iter().map(|text| &*text.leak()).collect::<Vec<_>>().leak())
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Scope {
    /// Every trace, which must have it.
    Every,
    /// Traces of any domain, if it has the schema's type.
    Any,
    #[default]
    Mirror,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorColumn {
    #[serde(skip)]
    pub name: Text,
    /// The one of [`WORDS`](super::colors::spelling::WORDS) that the column allows.
    #[serde(default, deserialize_with = "optional_text")]
    pub word: Option<Text>,
    #[serde(deserialize_with = "text")]
    pub(super) advice: Text,
}

mirrorstats_exact::names! {
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Stored {
        #[default]
        Bool = "bool",
        Int8 = "int8",
        Int32 = "int32",
        Int64 = "int64",
        Float32 = "float32",
        Float64 = "float64",
        String = "string",
    }
}

mirrorstats_exact::names! {
    /// The logical type of a column as a reader sees it, whatever its width or encoding in the file.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "lowercase")]
    pub enum Kind {
        /// True or false.
        Bool = "bool",
        /// An integer, read as 64 bits signed.
        Int = "integer",
        /// A floating-point number, read as 64 bits.
        Float = "float",
        /// Text.
        String = "string",
        /// Anything else: kept in the file, and of no use to a definition.
        Unsupported = "unsupported",
    }
}

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
    /// The column of this name, with the units of `counted` as counts.
    pub(super) fn named(mut self, name: &'static str, counted: &[String]) -> Self {
        self.name = name;
        self.nullable |= !self.required;
        self.counts = self.unit.is_some_and(|unit| counted.iter().any(|counted| counted == unit));
        self.color = self.color.map(|color| ColorColumn { name, ..color });
        self
    }

    /// The meaning of a missing value, if it is a text or a number and not an expression over other columns.
    pub fn default_text(&self) -> Option<&'static str> {
        let text = self.default?;
        let quoted = text.strip_prefix('\'').and_then(|text| text.strip_suffix('\''));
        quoted.or_else(|| text.bytes().all(|byte| byte.is_ascii_digit()).then_some(text))
    }
}
