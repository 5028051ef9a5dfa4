//! Parses one line as a flat JSON object: keys and plain values, in the order of the line.
//!
//! Rule: strict JSON, unique keys, no nested values. Numbers keep their written type: `1` is an integer, `1.0` is not.

use std::collections::HashSet;
use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde::de::{Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

use super::cell;
use super::error::{Fault, Location};
use super::format::json::{UNHELD, marked};
use super::value::{LineValue, Members};
use mirrorstats_exact::budget::Limit;

pub(super) const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// A step with its whole reply; the longest reply of a model has some hundred thousand bytes.
pub(super) const LONGEST_LINE: Limit = Limit::new("bytes in a line of steps", 16 << 20);

#[derive(Debug)]
pub(super) struct Line {
    pub(super) place: Location,
    pub(super) offset: u64,
    pub(super) bytes: Vec<u8>,
    /// True if it ends with a line feed; the last line of a truncated file does not.
    pub(super) ended: bool,
}

/// The keys and values of an object in their order, repeated ones included.
pub(super) struct Pairs<V = Value>(Vec<(String, V)>);

impl<V> Pairs<V> {
    pub(super) fn repeated(&self) -> Option<&str> {
        let mut seen = HashSet::with_capacity(self.0.len());
        self.0.iter().map(|(key, _)| key.as_str()).find(|key| !seen.insert(*key))
    }
}

impl Pairs {
    pub(super) fn row(&self) -> Vec<(&str, &Value)> {
        self.0.iter().map(|(key, value)| (key.as_str(), value)).collect()
    }
}

impl<'de, V: Deserialize<'de>> Deserialize<'de> for Pairs<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(PairsVisitor(PhantomData))
    }
}

struct PairsVisitor<V>(PhantomData<V>);

impl<'de, V: Deserialize<'de>> Visitor<'de> for PairsVisitor<V> {
    type Value = Pairs<V>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object, one step")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut pairs = Vec::new();
        while let Some(pair) = map.next_entry()? {
            pairs.push(pair);
        }
        Ok(Pairs(pairs))
    }
}

/// A value without what lists and objects hold. The parser steps over any depth of them, but reads only 128 levels.
struct Plain(Value);

impl<'de> Deserialize<'de> for Plain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PlainVisitor)
    }
}

struct PlainVisitor;

impl<'de> Visitor<'de> for PlainVisitor {
    type Value = Plain;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Plain, E> {
        Ok(Plain(Value::Null))
    }

    fn visit_bool<E>(self, value: bool) -> Result<Plain, E> {
        Ok(Plain(value.into()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Plain, E> {
        Ok(Plain(value.into()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Plain, E> {
        Ok(Plain(value.into()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Plain, E> {
        Ok(Plain(value.into()))
    }

    fn visit_str<E>(self, value: &str) -> Result<Plain, E> {
        Ok(Plain(value.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Plain, A::Error> {
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Plain(Value::Array(Vec::new())))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Plain, A::Error> {
        while map.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
        Ok(Plain(Value::Object(serde_json::Map::new())))
    }
}

/// The keys and values of a line, each key once; `ended` says whether it had a line feed.
pub(super) fn pairs<V: DeserializeOwned>(bytes: &[u8], ended: bool) -> Result<Pairs<V>, Box<Fault>> {
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let found = format!("other bytes after the first {}", error.valid_up_to());
        Box::new(Fault::new("text in UTF-8", found, "write the file as UTF-8"))
    })?;
    let text = text.trim_end();
    let marked = marked(text);
    let pairs = serde_json::from_str::<Pairs<V>>(&marked).map_err(|error| {
        let is_object = marked.trim_start().starts_with('{');
        Box::new(match if is_object { Err(error) } else { other_value(&marked) } {
            Ok(found) => Fault::new("a JSON object, one step", found, "write one object a line"),
            Err(error) => no_json(text, ended, &error),
        })
    })?;
    match pairs.repeated() {
        None => Ok(pairs),
        Some(key) => Err(Box::new(Fault::new("each key once", "the key twice", "keep one of them").of_key(key))),
    }
}

/// The description of a value that is not an object. A list may be too deep for the parser.
fn other_value(json: &str) -> serde_json::Result<String> {
    serde_json::from_str::<IgnoredAny>(json)?;
    let is_list = json.trim_start().starts_with('[');
    Ok(if is_list { LineValue::List.shown() } else { of_json(&serde_json::from_str(json)?).shown() })
}

pub(super) fn members(bytes: &[u8], ended: bool) -> Result<Members, Box<Fault>> {
    let Pairs(pairs) = pairs::<Plain>(bytes, ended)?;
    Ok(pairs.into_iter().map(|(key, Plain(value))| (key, of_json(&value))).collect())
}

fn of_text(text: &str) -> LineValue {
    text.strip_prefix(UNHELD).map_or_else(|| LineValue::Text(text.to_owned()), cell::number)
}

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
