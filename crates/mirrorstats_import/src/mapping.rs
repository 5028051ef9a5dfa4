//! Maps lines of another shape to flat steps: columns by paths, constants, and nested values left out.

use std::collections::BTreeMap;

use arrow::array::{Array as _, ArrayRef, RecordBatch, new_null_array};
use arrow::datatypes::DataType;
use indexmap::IndexMap;
use serde_json::{Map, Value, json};

use super::cell;
use super::format::json::marked;
use super::line;
use super::table::{RowValues, Unreadable};
use super::value::{LineValue, Node, whole};
use mirrorstats_exact::escape::visible;
use mirrorstats_trace::schema::domain::is_general;
use mirrorstats_trace::schema::{Kind, column};

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    columns: Vec<(String, Path)>,
    constants: Vec<(String, Value)>,
    left_out: BTreeMap<String, u64>,
    dropped: BTreeMap<String, u64>,
}

pub(super) type Row<'a> = [(&'a str, &'a Value)];

pub(super) struct MappedColumn<'m> {
    pub(super) name: &'m str,
    pub(super) values: RowValues,
    path: Option<&'m Path>,
}

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
        self.count_all_dropped(what, 1);
    }

    pub(super) fn count_all_dropped(&mut self, what: String, count: u64) {
        if count > 0 {
            *self.dropped.entry(what).or_default() += count;
        }
    }

    pub(super) fn reads(&self, keys: &str) -> bool {
        self.columns.iter().any(|(_, path)| path.is_at(keys) || path.is_within(keys))
    }

    pub(super) fn flat(&mut self, row: &Row<'_>) -> IndexMap<String, LineValue> {
        let mut flat: IndexMap<String, LineValue> =
            self.columns.iter().map(|(name, path)| (name.clone(), path.value(name, row))).collect();
        for (key, value) in row {
            match value {
                value if self.takes(key, value.is_array() || value.is_object()) => {}
                Value::Array(_) | Value::Object(_) => self.leave_out(key, 1),
                value => drop(flat.insert((*key).to_owned(), line::of_json(value))),
            }
        }
        flat.extend(self.constants());
        flat
    }

    /// The same for a row of cells.
    pub(super) fn flat_cells(&self, row: &[(&str, LineValue)]) -> IndexMap<String, LineValue> {
        let cell = |path: &Path| row.iter().find(|(key, _)| path.is_at(key)).map(|(_, cell)| cell.clone());
        let mapped = self.columns.iter().map(|(name, path)| {
            let found = cell(path).unwrap_or(LineValue::Null);
            (name.clone(), path.finished(name, found))
        });
        let others =
            row.iter().filter(|(key, _)| !self.takes(key, false)).map(|(key, cell)| ((*key).to_owned(), cell.clone()));
        mapped.chain(others).chain(self.constants()).collect()
    }

    /// The same for the columns of a table. Errors: a column with a value that has no text.
    pub(super) fn columns<'m>(
        &'m self,
        table: &'m RecordBatch,
    ) -> Result<Vec<MappedColumn<'m>>, (&'m str, Unreadable)> {
        let mapped = self.columns.iter().map(|(name, path)| (name.as_str(), Some(path), path.column(table)));
        let schema = table.schema_ref().fields().iter().map(|field| field.name().as_str());
        let others = schema.zip(table.columns());
        let others = others.filter(|(name, values)| !values.data_type().is_nested() && !self.takes(name, false));
        let others = others.map(|(name, values)| (name, None, Some(ArrayRef::clone(values))));
        let is_free = |name: &str| !self.constants.iter().any(|(constant, _)| constant == name);
        let columns = mapped.chain(others).filter(|(name, ..)| is_free(name));
        let column = |(name, path, values): (&'m str, _, Option<ArrayRef>)| {
            let values = values.unwrap_or_else(|| new_null_array(&DataType::Null, table.num_rows()));
            let values = RowValues::new(&values).map_err(|unreadable| (name, unreadable))?;
            Ok(MappedColumn { name, values, path })
        };
        columns.map(column).collect()
    }

    pub(super) fn constants(&self) -> impl Iterator<Item = (String, LineValue)> + '_ {
        self.constants.iter().map(|(name, value)| (name.clone(), line::of_json(value)))
    }

    pub(super) fn leave_out(&mut self, key: &str, rows: u64) {
        *self.left_out.entry(key.to_owned()).or_default() += rows;
    }

    /// Returns true if a path takes the value of this key, or another value takes its name.
    fn takes(&self, key: &str, is_nested: bool) -> bool {
        let takes = |path: &Path| path.is_at(key) || is_nested && path.is_within(key);
        self.columns.iter().any(|(name, path)| name == key || takes(path))
    }
}

impl MappedColumn<'_> {
    pub(super) fn at(&self, row: usize) -> Result<LineValue, Unreadable> {
        let value = self.values.at(row)?;
        Ok(match self.path {
            Some(path) => path.finished(self.name, value),
            None => value,
        })
    }
}

impl Path {
    fn is_at(&self, key: &str) -> bool {
        self.keys == key
    }

    fn is_within(&self, key: &str) -> bool {
        self.keys.strip_prefix(key).is_some_and(|rest| rest.starts_with('.'))
    }

    fn value(&self, name: &str, row: &Row<'_>) -> LineValue {
        let member = |key: &str| row.iter().find(|(name, _)| *name == key).map(|(_, value)| *value);
        self.finished(name, within(member, &self.keys).map_or(LineValue::Null, line::of_json))
    }

    fn column(&self, table: &RecordBatch) -> Option<ArrayRef> {
        within(|key| table.column_by_name(key).map(ArrayRef::clone), &self.keys)
    }

    /// The value with the number added. A number becomes text in columns that are text in every domain.
    fn finished(&self, name: &str, found: LineValue) -> LineValue {
        match self.added(found) {
            LineValue::Unheld(number) if is_general_text(name) => LineValue::Text(number),
            number @ (LineValue::Int(_) | LineValue::Float(_)) if is_general_text(name) => {
                LineValue::Text(number.shown())
            }
            value => value,
        }
    }

    fn added(&self, found: LineValue) -> LineValue {
        if self.added == 0 {
            return found;
        }
        let number = match &found {
            LineValue::Int(number) => Some(*number),
            LineValue::Float(number) => whole(*number),
            LineValue::Cell(text) => match cell::typed(text, Kind::Int) {
                LineValue::Int(number) => Some(number),
                _ => None,
            },
            _ => None,
        };
        let too_large = |number: i64| LineValue::Text(format!("{number}{:+}", self.added));
        let sum = |number: i64| number.checked_add(self.added).map_or_else(|| too_large(number), LineValue::Int);
        number.map_or(found, sum)
    }
}

pub(super) fn is_general_text(name: &str) -> bool {
    is_general(name) && column(name).is_some_and(|column| column.stored.kind() == Kind::String)
}

impl Node for &Value {
    fn member(&self, key: &str) -> Option<Self> {
        self.as_object()?.get(key)
    }

    fn item(&self, position: usize) -> Option<Self> {
        self.as_array()?.get(position)
    }
}

fn at<N: Node>(node: N, path: &str) -> Option<N> {
    if path.is_empty() {
        return Some(node);
    }
    within(|key| node.member(key), path).or_else(|| {
        let (position, rest) = path.split_once('.').unwrap_or((path, ""));
        at(node.item(position.parse().ok()?)?, rest)
    })
}

/// The value at a path that starts with the keys of `member`. Keys may contain dots.
fn within<N: Node>(member: impl Fn(&str) -> Option<N>, path: &str) -> Option<N> {
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
    let scalar = serde_json::from_str(&marked(&text))
        .ok()
        .filter(|value: &Value| !(is_text || value.is_array() || value.is_object()));
    (name, scalar.unwrap_or(Value::String(text)))
}
