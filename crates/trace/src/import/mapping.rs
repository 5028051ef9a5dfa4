//! Maps lines of another shape to flat steps: columns by paths, constants, and nested values left out.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::line;
use crate::schema::domain::is_general;
use crate::schema::{Kind, column};
use exact::escape::visible;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    columns: Vec<(String, Path)>,
    constants: Vec<(String, Value)>,
    left_out: BTreeMap<String, u64>,
    dropped: BTreeMap<String, u64>,
}

pub(super) type Row<'a> = [(&'a str, &'a Value)];

/// The path to a value in a line: keys and positions separated by dots, and an integer to add to the value.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Path {
    keys: String,
    added: i64,
}

/// A `--map` or `--set` without a column or a value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{}`: expected {expected}, found {found}", visible(.typed))]
pub struct MappingError {
    typed: String,
    expected: &'static str,
    found: &'static str,
}

impl Mapping {
    /// Parses columns from `COLUMN=PATH` and constants from `COLUMN=VALUE`.
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

    pub fn is_empty(&self) -> bool {
        self.columns.is_empty() && self.constants.is_empty()
    }

    /// A note for each key with lists or objects that were left out, and for each kind of record that is not a step.
    pub fn left_out(&self) -> Vec<String> {
        let nested = |(key, rows): (&String, &u64)| {
            format!(
                "left out: `{}`, a list or an object in {rows} lines; `--map COLUMN={0}.PATH` takes a value out of it",
                visible(key)
            )
        };
        let dropped = |(what, count): (&String, &u64)| format!("left out: {count} {}", visible(what));
        self.left_out.iter().map(nested).chain(self.dropped.iter().map(dropped)).collect()
    }

    pub(super) fn declared(&self) -> Value {
        let path =
            |path: &Path| if path.added == 0 { path.keys.clone() } else { format!("{}+{}", path.keys, path.added) };
        let columns: Map<String, Value> =
            self.columns.iter().map(|(name, at)| (name.clone(), json!(path(at)))).collect();
        let constants: Map<String, Value> = self.constants.iter().cloned().collect();
        json!({ "map": columns, "set": constants })
    }

    pub(super) fn count_dropped(&mut self, what: String) {
        *self.dropped.entry(what).or_default() += 1;
    }

    pub(super) fn reads(&self, keys: &str) -> bool {
        self.columns.iter().any(|(_, path)| path.is_at(keys) || path.is_within(keys))
    }

    pub(super) fn flat(&mut self, row: &Row<'_>) -> Map<String, Value> {
        let mut flat: Map<String, Value> =
            self.columns.iter().map(|(name, path)| (name.clone(), path.value(name, row))).collect();
        for (key, value) in row {
            match value {
                _ if flat.contains_key(*key) || self.columns.iter().any(|(_, path)| path.is_at(key)) => {}
                Value::Array(_) | Value::Object(_) if self.columns.iter().any(|(_, path)| path.is_within(key)) => {}
                Value::Array(_) | Value::Object(_) => *self.left_out.entry((*key).to_owned()).or_default() += 1,
                value => drop(flat.insert((*key).to_owned(), (*value).clone())),
            }
        }
        flat.extend(self.constants.iter().cloned());
        flat
    }
}

impl Path {
    fn is_at(&self, key: &str) -> bool {
        self.keys == key
    }

    fn is_within(&self, key: &str) -> bool {
        self.keys.strip_prefix(key).is_some_and(|rest| rest.starts_with('.'))
    }

    /// The value in a row; null if absent. A number becomes text in columns that are text in every domain.
    fn value(&self, name: &str, row: &Row<'_>) -> Value {
        let member = |key: &str| row.iter().find(|(name, _)| *name == key).map(|(_, value)| *value);
        let found = within(member, &self.keys).cloned().unwrap_or_default();
        let number = found.as_i64().or_else(|| found.as_f64().and_then(line::whole)).filter(|_| self.added != 0);
        let found = match number.and_then(|number| number.checked_add(self.added)) {
            Some(number) => Value::from(number),
            None => found,
        };
        if found.is_number() && is_general_text(name) { Value::String(found.to_string()) } else { found }
    }
}

pub(super) fn is_general_text(name: &str) -> bool {
    is_general(name) && column(name).is_some_and(|column| column.stored.kind() == Kind::String)
}

fn at<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    match value {
        value if path.is_empty() => Some(value),
        Value::Object(members) => within(|key| members.get(key), path),
        Value::Array(list) => {
            let (position, rest) = path.split_once('.').unwrap_or((path, ""));
            at(list.get(position.parse::<usize>().ok()?)?, rest)
        }
        _ => None,
    }
}

/// The value at a path that starts with the keys of `member`. Keys may contain dots.
fn within<'v>(member: impl Fn(&str) -> Option<&'v Value>, path: &str) -> Option<&'v Value> {
    let nested = || path.match_indices('.').find_map(|(dot, _)| at(member(&path[..dot])?, &path[dot + 1..]));
    member(path).or_else(nested)
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
