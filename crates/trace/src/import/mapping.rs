//! Lines of another shape as flat steps: columns by the paths of their values, constants, and what is nested left out.

use std::collections::BTreeMap;
use std::io::{self, Write};

use serde_json::{Map, Value};

use super::line;
use crate::schema::{Kind, column};
use exact::escape::visible;

/// What becomes of the keys of foreign lines, and what was left out of them so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    columns: Vec<(String, Path)>,
    constants: Vec<(String, Value)>,
    left_out: BTreeMap<String, u64>,
}

/// Where a value is in a line: keys and positions with dots between them, and what is added to an integer there.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Path {
    keys: String,
    added: i64,
}

/// A `--map` or `--set` without a column or a value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{}`: expected {expected}, found {found}", visible(.typed))]
pub struct MappingError {
    /// As it was typed.
    typed: String,
    expected: &'static str,
    found: &'static str,
}

impl Mapping {
    /// Columns by `COLUMN=PATH` and constants by `COLUMN=VALUE`.
    pub fn parse(columns: &[String], constants: &[String]) -> Result<Self, MappingError> {
        let path = |text: &str| match text.rsplit_once('+').map(|(keys, added)| (keys, added.parse())) {
            Some((keys, Ok(added))) => Path { keys: keys.to_owned(), added },
            _ => Path { keys: text.to_owned(), added: 0 },
        };
        let columns = columns.iter().map(|typed| pair(typed, "COLUMN=PATH").map(|(name, text)| (name, path(&text))));
        let constants =
            constants.iter().map(|typed| pair(typed, "COLUMN=VALUE").map(|(name, text)| constant(name, text)));
        Ok(Self {
            columns: columns.collect::<Result<_, _>>()?,
            constants: constants.collect::<Result<_, _>>()?,
            ..Self::default()
        })
    }

    /// Returns true if lines stay as they are.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty() && self.constants.is_empty()
    }

    /// A note for each key whose lists or objects were left out.
    pub fn left_out(&self) -> Vec<String> {
        let note = |(key, lines): (&String, &u64)| {
            format!(
                "left out: `{}`, a list or an object in {lines} lines; `--map COLUMN={0}.PATH` takes a value out of it",
                visible(key)
            )
        };
        self.left_out.iter().map(note).collect()
    }

    pub(super) fn write(&mut self, bytes: &[u8], out: &mut impl Write) -> io::Result<()> {
        let object = line::members(bytes, true).ok().and_then(|_| serde_json::from_slice(bytes.trim_ascii()).ok());
        match object {
            Some(Value::Object(object)) => {
                serde_json::to_writer(&mut *out, &self.flat(object))?;
                out.write_all(b"\n")
            }
            _ => out.write_all(bytes),
        }
    }

    fn flat(&mut self, object: Map<String, Value>) -> Map<String, Value> {
        let object = Value::Object(object);
        let mut flat: Map<String, Value> =
            self.columns.iter().map(|(name, path)| (name.clone(), path.value(&object))).collect();
        let Value::Object(object) = object else { return flat };
        for (key, value) in object {
            let is_taken = flat.contains_key(&key) || self.columns.iter().any(|(_, path)| path.keys == key);
            let is_within =
                |(_, path): &(String, Path)| path.keys.strip_prefix(&key).is_some_and(|rest| rest.starts_with('.'));
            match value {
                _ if is_taken => {}
                Value::Array(_) | Value::Object(_) if self.columns.iter().any(is_within) => {}
                Value::Array(_) | Value::Object(_) => *self.left_out.entry(key).or_default() += 1,
                value => drop(flat.insert(key, value)),
            }
        }
        flat.extend(self.constants.iter().cloned());
        flat
    }
}

impl Path {
    /// The value in a line; null where there is none.
    fn value(&self, line: &Value) -> Value {
        let found = at(line, &self.keys).cloned().unwrap_or_default();
        match found.as_i64().and_then(|number| number.checked_add(self.added)) {
            Some(number) => Value::from(number),
            None => found,
        }
    }
}

fn at<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    match value {
        value if path.is_empty() => Some(value),
        Value::Object(members) => members.get(path).or_else(|| {
            let mut dots = path.match_indices('.');
            dots.find_map(|(dot, _)| at(members.get(&path[..dot])?, &path[dot + 1..]))
        }),
        Value::Array(list) => {
            let (position, rest) = path.split_once('.').unwrap_or((path, ""));
            at(list.get(position.parse::<usize>().ok()?)?, rest)
        }
        _ => None,
    }
}

fn pair(typed: &str, expected: &'static str) -> Result<(String, String), MappingError> {
    let fault = |found| MappingError { typed: typed.to_owned(), expected, found };
    let (name, text) = typed.split_once('=').ok_or_else(|| fault("no `=`"))?;
    if name.is_empty() || text.is_empty() {
        return Err(fault("nothing on one side of `=`"));
    }
    Ok((name.to_owned(), text.to_owned()))
}

fn constant(name: String, text: String) -> (String, Value) {
    let is_text = column(&name).is_some_and(|column| column.stored.kind() == Kind::String);
    let scalar =
        serde_json::from_str(&text).ok().filter(|value: &Value| !(is_text || value.is_array() || value.is_object()));
    (name, scalar.unwrap_or(Value::String(text)))
}
