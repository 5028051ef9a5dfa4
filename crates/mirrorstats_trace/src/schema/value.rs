use arrow::array::{Array as _, ArrayRef, AsArray as _};
use arrow::datatypes::{DataType, Float64Type, Int32Type, Int64Type};

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'a> {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
}

impl Value<'_> {
    /// The value for a message.
    pub(crate) fn shown(self, escaped: fn(&str) -> String) -> String {
        match self {
            Self::Bool(truth) => truth.to_string(),
            Self::Int(number) => number.to_string(),
            Self::Float(number) => number.to_string(),
            Self::Text(text) => format!("`{}`", escaped(text)),
        }
    }
}

/// The value at a row of an array of 64-bit numbers, truth values or texts; `None` for null.
pub(crate) fn value_at(values: &ArrayRef, row: usize) -> Option<Value<'_>> {
    values.is_valid(row).then(|| match values.data_type() {
        DataType::Boolean => Value::Bool(values.as_boolean().value(row)),
        DataType::Int64 => Value::Int(values.as_primitive::<Int64Type>().value(row)),
        DataType::Float64 => Value::Float(values.as_primitive::<Float64Type>().value(row)),
        DataType::Utf8 => Value::Text(values.as_string::<i32>().value(row)),
        _ => {
            let texts = values.as_dictionary::<Int32Type>();
            Value::Text(texts.values().as_string::<i32>().value(texts.key(row).unwrap_or_default()))
        }
    })
}
