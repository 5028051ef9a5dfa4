//! Parses one line as a flat JSON object: keys and plain values, in the order of the line.
//!
//! Rule: strict JSON, unique keys, no nested values. Numbers keep their written type: `1` is an integer, `1.0` is not.

use std::collections::HashSet;
use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::cell;
use super::error::Fault;
use super::format::json::{UNHELD, marked};
use mirrorstats_exact::escape::{exact, visible};

pub(super) const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

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

/// The keys and values of a line; `ended` says whether it had a line feed.
pub(super) fn members(bytes: &[u8], ended: bool) -> Result<Members, Box<Fault>> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let found = format!("other bytes after the first {}", error.valid_up_to());
        Box::new(Fault::new("text in UTF-8", found, "write the file as UTF-8"))
    })?;
    let marked = marked(text.trim_end());
    let mut json = serde_json::Deserializer::from_str(&marked);
    match (Plain { is_line: true }).deserialize(&mut json).and_then(|value| json.end().map(|()| value)) {
        Ok(LineValue::Object(members)) => Ok(unique(members)?),
        Ok(other) => Err(Box::new(Fault::new("a JSON object, one step", other.shown(), "write one object a line"))),
        Err(error) => Err(Box::new(no_json(text.trim_end(), ended, &error))),
    }
}

fn of_text(text: &str) -> LineValue {
    text.strip_prefix(UNHELD).map_or_else(|| LineValue::Text(text.to_owned()), cell::number)
}

/// The integer that a number with a point equals, as in `2.0`.
#[expect(clippy::cast_possible_truncation, reason = "it is whole and within 2^53")]
pub(super) fn whole(number: f64) -> Option<i64> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    (number.fract() == 0.0 && number.abs() <= EXACT).then_some(number as i64)
}

/// The values of a stored row.
pub(super) fn of_record(bytes: &[u8]) -> Result<Members, Box<Fault>> {
    if bytes.is_empty() {
        return Ok(Members::new());
    }
    let damaged = |error: rmp_serde::decode::Error| Fault::new("a stored row", error.to_string(), "import it again");
    rmp_serde::from_slice(bytes).map_err(|error| Box::new(damaged(error)))
}

/// A row as its source stores it between the passes.
pub(super) fn to_record(row: &Members) -> Vec<u8> {
    rmp_serde::to_vec(row).expect("texts and numbers have a form in memory")
}

pub(super) fn of_json(value: &Value) -> LineValue {
    match value {
        Value::Null => LineValue::Null,
        Value::Bool(value) => LineValue::Bool(*value),
        Value::Number(number) => match (number.as_i64(), number.as_u64()) {
            (Some(value), _) => LineValue::Int(value),
            (None, Some(value)) => LineValue::Unheld(value.to_string()),
            (None, None) => LineValue::Float(number.as_f64().unwrap_or(f64::NAN)),
        },
        Value::String(text) => of_text(text),
        Value::Array(_) => LineValue::List,
        Value::Object(_) => LineValue::Object(Members::new()),
    }
}

fn unique(members: Members) -> Result<Members, Box<Fault>> {
    let mut seen = HashSet::with_capacity(members.len());
    match members.iter().find(|(key, _)| !seen.insert(key.as_str())) {
        None => Ok(members),
        Some((key, _)) => Err(Box::new(Fault::new("each key once", "the key twice", "keep one of them").of_key(key))),
    }
}

fn no_json(text: &str, ended: bool, error: &serde_json::Error) -> Fault {
    let words = error.to_string();
    let what = words.split(" at line ").next().unwrap_or(&words);
    let found = format!("{what} at character {}", character(text, error.column()));
    let help = if is_no_number(text, error.column()) {
        "JSON has no NaN and no infinity: write null where there is no number"
    } else if error.is_eof() && !ended {
        "the file was cut off while it was written: complete the line, or remove it and what belongs to it"
    } else if error.is_eof() {
        "write each object in one line, without line breaks inside"
    } else {
        "correct the line; nothing is skipped"
    };
    Fault::new("strict JSON", found, help)
}

fn is_no_number(text: &str, byte: usize) -> bool {
    let start = text.floor_char_boundary(byte.saturating_sub(2));
    let around: String = text[start..].chars().take(4).collect();
    ["NaN", "Inf"].iter().any(|word| around.contains(word))
}

/// The position of this byte in characters, both from 1.
fn character(text: &str, byte: usize) -> usize {
    text.get(..text.floor_char_boundary(byte)).map_or(byte, |before| before.chars().count())
}

/// The line itself, or a value inside it; the contents of lists and objects there are read and dropped.
struct Plain {
    is_line: bool,
}

impl<'de> DeserializeSeed<'de> for Plain {
    type Value = LineValue;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<LineValue, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Plain {
    type Value = LineValue;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<LineValue, E> {
        Ok(LineValue::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<LineValue, E> {
        Ok(LineValue::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<LineValue, E> {
        Ok(LineValue::Int(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<LineValue, E> {
        Ok(i64::try_from(value).map_or_else(|_| LineValue::Unheld(value.to_string()), LineValue::Int))
    }

    fn visit_f64<E>(self, value: f64) -> Result<LineValue, E> {
        Ok(LineValue::Float(value))
    }

    fn visit_str<E>(self, text: &str) -> Result<LineValue, E> {
        Ok(of_text(text))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<LineValue, A::Error> {
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(LineValue::List)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<LineValue, A::Error> {
        let mut members = Members::new();
        while let Some(key) = map.next_key()? {
            if self.is_line {
                members.push((key, map.next_value_seed(Self { is_line: false })?));
            } else {
                map.next_value::<IgnoredAny>()?;
            }
        }
        Ok(LineValue::Object(members))
    }
}

#[cfg(test)]
mod tests {
    use super::{LineValue, members};

    #[test]
    fn numbers_keep_their_spelling() {
        let line = r#"{"a":1,"b":1.0,"c":-9223372036854775808,"d":18446744073709551615,"e":1e3,"f":null}"#;
        let values: Vec<_> = members(line.as_bytes(), true).unwrap().into_iter().map(|(_, value)| value).collect();
        let (int, float) = (LineValue::Int, LineValue::Float);
        let expected = [
            int(1),
            float(1.0),
            int(i64::MIN),
            LineValue::Unheld(u64::MAX.to_string()),
            float(1000.0),
            LineValue::Null,
        ];
        assert_eq!(values, expected);
    }

    #[test]
    fn nested_objects_are_reported() {
        let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
        for (line, expected, found) in [
            ("[1]", "a JSON object, one step", "a list"),
            ("null", "a JSON object, one step", "null"),
            (r#"{"a":1,"a":1}"#, "each key once", "the key twice"),
            (r#"{"a":1} {"#, "strict JSON", "trailing characters at character 9"),
            (r#"{"a":"\ud800"}"#, "strict JSON", "unexpected end of hex escape at character 13"),
            (&deep, "a JSON object, one step", "a list"),
        ] {
            let fault = members(line.as_bytes(), true).unwrap_err();
            let short = &line[..line.len().min(20)];
            assert_eq!((fault.expected.as_str(), fault.found.as_str()), (expected, found), "{short}");
        }
        assert!(members(b"{\"a\":\"\xff\"}", true).unwrap_err().found.ends_with("the first 6"));
    }

    #[test]
    fn help_explains_nan_and_truncated_lines() {
        let help = |line: &str, ended| members(line.as_bytes(), ended).unwrap_err().help;
        for line in [r#"{"a": NaN}"#, r#"{"a": Infinity}"#, r#"{"a": -Infinity}"#] {
            assert!(help(line, true).contains("no NaN"), "{line}: {}", help(line, true));
        }
        assert!(help(r#"{"a": "NaN"#, false).contains("cut off"));
        assert!(help("{", true).contains("in one line"));
        assert!(help("{'a': 1}", true).contains("correct the line"));
    }
}
