//! JSON: an object per line, a list of objects, or one object with lists of rows.
//!
//! Rule: strict JSON with unique keys. Numbers keep their written type: `1` is an integer, `1.0` is not.

use std::collections::HashSet;
use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use crate::beside::StepFile;
use crate::error::{Fault, ImportError, Location};
use crate::json::{BYTE_ORDER_MARK, from_reader, marked};
use crate::mapping;
use crate::rows::{LONGEST_LINE, Rows, Scope};
use crate::value::Cell;
use mirrorstats_exact::input;

/// Adds the rows of each line. A bad line does not stop the search for others.
pub(super) fn read_lines(reader: &mut BufReader<File>, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    (rows.noun, rows.is_strict) = ("line", rows.mapping.is_empty());
    each_line(reader, rows, add)
}

fn each_line(
    reader: &mut BufReader<File>,
    rows: &mut Rows<'_>,
    mut add: impl FnMut(&mut Rows<'_>, &Value, u64) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let mut line = 0;
    loop {
        let mut bytes = input::line(reader, LONGEST_LINE).map_err(ImportError::read(&rows.file))?;
        if bytes.is_empty() {
            return Ok(());
        }
        line += 1;
        let ended = bytes.ends_with(b"\n");
        if line == 1 && bytes.starts_with(BYTE_ORDER_MARK) {
            bytes.drain(..BYTE_ORDER_MARK.len());
        }
        if bytes.trim_ascii().is_empty() {
            continue;
        }
        // Without a mapping, what is nested is refused at any depth; the parser reads only 128 levels.
        let object = if rows.is_strict { object::<Plain>(&bytes, ended) } else { object::<Value>(&bytes, ended) };
        match object {
            Ok(object) => add(rows, &Value::Object(object), line)?,
            Err(fault) => {
                let place = Location { file: rows.file.as_str().into(), noun: rows.noun, line };
                rows.faults.add(fault.at(&place));
            }
        }
    }
}

/// Adds the rows of a list of objects.
pub(super) fn read_list(reader: BufReader<File>, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    let refused = |rows: &Rows<'_>, found: String| {
        let help =
            "correct the file, or write one object a line, as `jq -c '.[]'` does; NaN and infinities are no JSON";
        rows.fault("", "a list of objects in strict JSON, one per step", found, help)
    };
    let list = from_reader::<Vec<Pairs>>(reader, false);
    for (pairs, row) in list.map_err(|error| refused(rows, error.to_string()))?.into_iter().zip(1..) {
        let object = pairs.object().map_err(|key| refused(rows, format!("the key {key:?} twice in item {row}")))?;
        add(rows, &Value::Object(object), row)?;
    }
    Ok(())
}

/// Adds the rows of an object that is the whole file.
pub(super) fn read_object(reader: BufReader<File>, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    let help = "name a file of this kind; another one has another --from";
    let about = if rows.mapping.settings.about.is_empty() { "one JSON object" } else { &*rows.mapping.settings.about };
    let object: Value = from_reader(reader, true).map_err(|error| rows.fault("", about, error.to_string(), help))?;
    let scope = Scope::new("", &object);
    for (path, value) in &rows.mapping.settings.requires {
        let found = scope.find(path).unwrap_or(&Value::Null);
        if found != value {
            return Err(rows.fault("", about, format!("{path} {found}"), help));
        }
    }
    if let Some(list) = rows.mapping.lists.first().filter(|list| !scope.find(&list.key).is_some_and(Value::is_array)) {
        return Err(rows.fault("", about, format!("no list `{}`", list.key), help));
    }
    let mapping = rows.mapping;
    if mapping.lists.is_empty() {
        return add(rows, &object, 1);
    }
    walk(rows, &mapping.lists, &mut vec![scope], None)
}

fn add(rows: &mut Rows<'_>, object: &Value, line: u64) -> Result<(), ImportError> {
    let mapping = rows.mapping;
    if let Some(items) = rows_of_table(object).filter(|_| mapping.lists.is_empty() && !rows.is_strict) {
        let mut items = items.iter().enumerate();
        return items.try_for_each(|(index, value)| rows.add(&[Scope { name: "", value, index: Some(index) }]));
    }
    walk(rows, &mapping.lists, &mut vec![Scope::new("", object)], Some(line))
}

/// The rows of a table that lists its columns' names beside rows without names, as Weights & Biases and pandas
/// (`orient="split"`) write it; `None` for any other object.
pub(crate) fn rows_of_table(object: &Value) -> Option<Vec<Value>> {
    let names = object.get("columns")?.as_array()?.iter().map(Value::as_str).collect::<Option<Vec<_>>>()?;
    let is_new = |(at, name): (usize, &&str)| !names[..at].contains(name);
    let rows = object.get("data")?.as_array()?.iter().map(Value::as_array).collect::<Option<Vec<_>>>()?;
    if !names.iter().enumerate().all(is_new) || rows.iter().any(|row| row.len() != names.len()) {
        return None;
    }
    let members = |row: &Vec<Value>| names.iter().map(|name| (*name).to_owned()).zip(row.iter().cloned()).collect();
    Some(rows.into_iter().map(|row| Value::Object(members(row))).collect())
}

/// Adds a row for each item of the innermost list. Items have the line of their object, or else are counted.
fn walk<'a>(
    rows: &mut Rows<'_>,
    levels: &'a [mapping::List],
    scopes: &mut Vec<Scope<'a>>,
    line: Option<u64>,
) -> Result<(), ImportError> {
    let Some((level, inner)) = levels.split_first() else { return add_row(rows, scopes, line) };
    let list = scopes.last().and_then(|scope| scope.find(&level.key)).and_then(Value::as_array);
    let items = list.map_or(&[][..], Vec::as_slice);
    if items.is_empty() {
        rows.notes.count(format!("objects without an item of `{}`", level.key), 1);
    }
    for (index, value) in items.iter().enumerate() {
        scopes.push(Scope { name: &level.item, value, index: Some(index) });
        walk(rows, inner, scopes, line)?;
        scopes.pop();
    }
    Ok(())
}

/// Adds the row in the last scope, or instead the steps in its own file, which have its values too.
fn add_row(rows: &mut Rows<'_>, scopes: &[Scope<'_>], line: Option<u64>) -> Result<(), ImportError> {
    let line = line.unwrap_or_else(|| rows.next_line());
    let added = match rows.steps_beside(scopes, line)? {
        None => 0,
        Some(StepFile { name, file, bytes }) => rows.within(&name, bytes, line, |rows| {
            each_line(&mut BufReader::new(file), rows, |rows, step, line| {
                let scopes: Vec<_> = scopes.iter().copied().chain([Scope::new("", step)]).collect();
                rows.add_line(&scopes, line)
            })
        })?,
    };
    if added == 0 { rows.add_line(scopes, line) } else { Ok(()) }
}

/// The keys and values of an object in their order, repeated ones included.
struct Pairs<V = Value>(Vec<(String, V)>);

impl<V: Into<Value>> Pairs<V> {
    /// Errors: a repeated key.
    fn object(self) -> Result<Map<String, Value>, String> {
        let mut seen = HashSet::with_capacity(self.0.len());
        match self.0.iter().map(|(key, _)| key).find(|key| !seen.insert(*key)) {
            Some(key) => Err(key.clone()),
            None => Ok(self.0.into_iter().map(|(key, value)| (key, value.into())).collect()),
        }
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

impl From<Plain> for Value {
    fn from(Plain(value): Plain) -> Self {
        value
    }
}

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
fn object<V: DeserializeOwned + Into<Value>>(bytes: &[u8], ended: bool) -> Result<Map<String, Value>, Box<Fault>> {
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
    let twice = |key: String| Fault::new("each key once", "the key twice", "keep one of them").of_key(&key);
    pairs.object().map_err(|key| Box::new(twice(key)))
}

/// The description of a value that is not an object. A list may be too deep for the parser.
fn other_value(json: &str) -> serde_json::Result<String> {
    serde_json::from_str::<IgnoredAny>(json)?;
    let is_list = json.trim_start().starts_with('[');
    Ok(if is_list { Cell::List.shown() } else { Cell::of_json(&serde_json::from_str(json)?).shown() })
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
    use serde_json::{Map, Value};

    use super::{Cell, Fault, Plain, object};

    fn members(line: &[u8], ended: bool) -> Result<Map<String, Value>, Box<Fault>> {
        object::<Plain>(line, ended)
    }

    #[test]
    fn numbers_keep_their_spelling() {
        let line = r#"{"a":1,"b":1.0,"c":-9223372036854775808,"d":18446744073709551615,"e":1e3,"f":null}"#;
        let values: Vec<Value> = members(line.as_bytes(), true).unwrap().into_iter().map(|(_, value)| value).collect();
        let values: Vec<_> = values.iter().map(Cell::of_json).collect();
        let (int, float) = (Cell::Int, Cell::Float);
        let expected =
            [int(1), float(1.0), int(i64::MIN), Cell::Unheld(u64::MAX.to_string().into()), float(1000.0), Cell::Null];
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
