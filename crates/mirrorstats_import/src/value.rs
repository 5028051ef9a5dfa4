//! One value of a column, as checks and messages see it.

use std::borrow::Cow;

use arrow::array::{Array, AsArray as _};
use arrow::datatypes::{DataType, Float64Type, Int64Type, UInt64Type};
use serde_json::Value;

use super::json::UNHELD;
use super::spelling::{self, whole};
use mirrorstats_exact::escape::{exact, visible};
use mirrorstats_trace::schema::Kind;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell<'a> {
    Null,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(Cow<'a, str>),
    /// A text whose type follows from its column, as in CSV.
    Spelled(Cow<'a, str>),
    /// A number that neither 64-bit integers nor floats hold, and an integer that only floats hold.
    Unheld(Cow<'a, str>),
    List,
    Object,
}

/// Arrow has three layouts of texts. Between the passes they say what is known about the type of a text.
pub(super) const TEXT: DataType = DataType::Utf8;
pub(super) const SPELLED: DataType = DataType::LargeUtf8;
pub(super) const UNHELD_NUMBER: DataType = DataType::Utf8View;

impl<'a> Cell<'a> {
    /// The value in this row of a column that `arrays::plain` or a builder made.
    pub(super) fn at(values: &'a dyn Array, row: usize) -> Self {
        match values.data_type() {
            _ if values.is_null(row) => Self::Null,
            DataType::Null => Self::Null,
            DataType::Boolean => Self::Bool(values.as_boolean().value(row)),
            DataType::Int64 => Self::Int(values.as_primitive::<Int64Type>().value(row)),
            DataType::UInt64 => {
                let number = values.as_primitive::<UInt64Type>().value(row);
                i64::try_from(number).map_or_else(|_| Self::Unheld(number.to_string().into()), Self::Int)
            }
            DataType::Float64 => Self::Float(values.as_primitive::<Float64Type>().value(row)),
            DataType::Utf8 => Self::Text(values.as_string::<i32>().value(row).into()),
            DataType::LargeUtf8 => Self::Spelled(values.as_string::<i64>().value(row).into()),
            DataType::Utf8View => Self::Unheld(values.as_string_view().value(row).into()),
            DataType::Struct(_) | DataType::Map(..) => Self::Object,
            _ => Self::List,
        }
    }

    pub(super) fn of_json(value: &'a Value) -> Self {
        match value {
            Value::Null => Self::Null,
            Value::Bool(value) => Self::Bool(*value),
            Value::Number(number) => match (number.as_i64(), number.as_u64()) {
                (Some(value), _) => Self::Int(value),
                (None, Some(value)) => Self::Unheld(value.to_string().into()),
                (None, None) => Self::Float(number.as_f64().unwrap_or(f64::NAN)),
            },
            Value::String(text) => text.strip_prefix(UNHELD).map_or(Self::Text(text.into()), spelling::number),
            Value::Array(_) => Self::List,
            Value::Object(_) => Self::Object,
        }
    }

    /// The value in a column of this type, if one is known: spelled ones get it, and whole numbers with a point are integers, which data
    /// frames write beside missing values.
    pub(super) fn typed(self, kind: impl Into<Option<Kind>>) -> Self {
        let Some(kind) = kind.into() else { return self };
        match (self, kind) {
            (Self::Spelled(text), _) | (Self::Unheld(text), Kind::Float) => spelling::typed(text, kind),
            (Self::Float(number), Kind::Int) => whole(number).map_or(Self::Float(number), Self::Int),
            (value, _) => value,
        }
    }

    /// The type of the value; `None` if it is null, nested or a number that no type holds.
    pub(super) fn kind(&self) -> Option<Kind> {
        match self {
            Self::Bool(_) => Some(Kind::Bool),
            Self::Int(_) => Some(Kind::Int),
            Self::Float(_) => Some(Kind::Float),
            Self::Text(_) => Some(Kind::String),
            Self::Spelled(text) => Some(spelling::kind_of(text)),
            Self::Null | Self::Unheld(_) | Self::List | Self::Object => None,
        }
    }

    pub(super) fn into_owned(self) -> Cell<'static> {
        match self {
            Self::Null => Cell::Null,
            Self::Bool(value) => Cell::Bool(value),
            Self::Int(number) => Cell::Int(number),
            Self::Float(number) => Cell::Float(number),
            Self::Text(text) => Cell::Text(text.into_owned().into()),
            Self::Spelled(text) => Cell::Spelled(text.into_owned().into()),
            Self::Unheld(text) => Cell::Unheld(text.into_owned().into()),
            Self::List => Cell::List,
            Self::Object => Cell::Object,
        }
    }

    pub(super) const fn bool(&self) -> Option<bool> {
        if let Self::Bool(value) = self { Some(*value) } else { None }
    }

    pub(super) const fn int(&self) -> Option<i64> {
        if let Self::Int(number) = self { Some(*number) } else { None }
    }

    /// The number as a column of floats stores it, which takes only integers that it holds.
    #[expect(clippy::cast_precision_loss, reason = "columns of floats take only integers that they hold")]
    pub(super) fn float(&self) -> Option<f64> {
        match self {
            Self::Int(number) => Some(*number as f64),
            Self::Float(number) => Some(*number),
            _ => None,
        }
    }

    /// Returns true if a column stores both as one value: `1` and `1.0`, or NaN twice.
    pub(super) fn is_same(&self, other: &Cell<'_>) -> bool {
        match (self, other) {
            (Self::Float(_), _) | (_, Cell::Float(_)) => {
                self.float().zip(other.float()).is_some_and(|(one, two)| one.to_bits() == two.to_bits())
            }
            _ => self == other,
        }
    }

    /// The bytes of its text.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Text(text) | Self::Spelled(text) | Self::Unheld(text) => text.len(),
            _ => 0,
        }
    }

    /// The value as a text column has it; `None` if it is null or nested.
    pub(super) fn text(&self) -> Option<Cow<'_, str>> {
        match self {
            Self::Text(text) | Self::Spelled(text) | Self::Unheld(text) => Some(Cow::Borrowed(text)),
            Self::Bool(_) | Self::Int(_) | Self::Float(_) => Some(Cow::Owned(self.shown())),
            Self::Null | Self::List | Self::Object => None,
        }
    }

    pub(super) fn shown(&self) -> String {
        const LONGEST: usize = 60;
        match self {
            Self::Null => "null".into(),
            Self::Bool(value) => value.to_string(),
            Self::Int(value) => value.to_string(),
            Self::Float(value) => format!("{value:?}"),
            Self::Text(text) | Self::Spelled(text) if text.chars().count() > LONGEST => {
                format!("the text `{}...`", visible(&text.chars().take(LONGEST).collect::<String>()))
            }
            Self::Text(text) | Self::Spelled(text) => format!("the text `{}`", exact(text)),
            Self::Unheld(number) => number.chars().take(LONGEST).collect(),
            Self::List => "a list".into(),
            Self::Object => "an object".into(),
        }
    }
}
