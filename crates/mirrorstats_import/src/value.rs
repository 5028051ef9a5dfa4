//! The values of lines and rows.

use serde::{Deserialize, Serialize};

use mirrorstats_exact::escape::{exact, visible};

/// A value of a line or row. Rows of tables are stored with it, so that no value passes through text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum LineValue {
    Null,
    Bool(bool),
    Int(i64),
    /// The spelling of a number that neither 64-bit integers nor floats hold, and of integers that only floats hold.
    Unheld(String),
    Float(f64),
    Text(String),
    /// A cell of CSV, whose type follows from its column.
    Cell(String),
    List,
    Object(Members),
}

/// Keys and values in the order of the line; those of a nested object are dropped.
pub(super) type Members = Vec<(String, LineValue)>;

impl LineValue {
    /// Returns true if a column stores both as one value: `1` and `1.0`, or NaN twice.
    #[expect(clippy::cast_precision_loss, reason = "columns of floats take only integers that they hold")]
    pub(super) fn is_same(&self, other: &Self) -> bool {
        let float = |value: &Self| match value {
            Self::Int(number) => Some(*number as f64),
            Self::Float(number) => Some(*number),
            _ => None,
        };
        match (self, other) {
            (Self::Float(_), _) | (_, Self::Float(_)) => {
                float(self).zip(float(other)).is_some_and(|(one, two)| one.to_bits() == two.to_bits())
            }
            _ => self == other,
        }
    }

    pub(super) fn shown(&self) -> String {
        const LONGEST: usize = 60;
        match self {
            Self::Null => "null".into(),
            Self::Bool(value) => value.to_string(),
            Self::Int(value) => value.to_string(),
            Self::Float(value) => format!("{value:?}"),
            Self::Text(text) | Self::Cell(text) if text.chars().count() > LONGEST => {
                format!("the text `{}...`", visible(&text.chars().take(LONGEST).collect::<String>()))
            }
            Self::Unheld(number) => number.chars().take(LONGEST).collect(),
            Self::Text(text) | Self::Cell(text) => format!("the text `{}`", exact(text)),
            Self::List => "a list".into(),
            Self::Object(_) => "an object".into(),
        }
    }
}

/// The integer that a number with a point equals, as in `2.0`.
#[expect(clippy::cast_possible_truncation, reason = "it is whole and within 2^53")]
pub(super) fn whole(number: f64) -> Option<i64> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
}

/// A value, or a column of them, with parts.
pub(super) trait Node: Sized {
    fn member(&self, key: &str) -> Option<Self>;
    fn item(&self, position: usize) -> Option<Self>;
}
