//! Makes steps of rows of any shape: columns by paths, texts of several values, constants, order.
//!
//! A mapping is data: a file of a user or one in `assets/import`, and `--map` and `--set` on top of it.

use std::path::Path as FilePath;
use std::sync::Arc;

use arrow::array::{ArrayRef, Int64Array, RecordBatch, StringArray, new_null_array};
use arrow::datatypes::DataType;
use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::arrays::{self, Node, Unreadable, array, plain};
use super::format::Format;
use super::json::marked;
use super::value::Cell;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::input;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::schema::domain::is_general;
use mirrorstats_trace::schema::{Kind, column};

const LARGEST_FILE: Limit = Limit::new("bytes of a mapping file", 1 << 20);

#[derive(Clone, Debug, Default)]
pub struct Mapping {
    pub format: Option<Format>,
    /// The lists that hold the rows of an object, from the outside.
    pub(super) lists: Vec<List>,
    pub(super) settings: Settings,
    columns: IndexMap<String, Source>,
    /// True if an entry whose path is not in a table gives no column, instead of nulls.
    is_built_in: bool,
    /// True if it was in a definition file, whose steps may come from other formats too.
    is_of_definitions: bool,
}

/// A file with a mapping. It may be a definition file, whose other tables are read there.
#[derive(Deserialize)]
struct MappingFile {
    import: Settings,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Settings {
    format: Option<String>,
    rows: String,
    /// A pattern of the ends of paths, such as `{model}/{level}/result.json`, whose parts are values of every row.
    pub(super) path: String,
    /// Values by which rows are left out.
    pub(super) skip: IndexMap<String, Value>,
    /// Required columns of the mirror's domain that have no meaning in the files.
    pub(super) absent: Vec<String>,
    /// A prefix for the names of columns that no entry names.
    pub(super) others: String,
    /// The description of a file that the mapping reads, and values that it has.
    pub(super) about: String,
    pub(super) requires: IndexMap<String, Value>,
    columns: IndexMap<String, Value>,
}

/// Values of a file for each of its rows, such as parts of its path.
pub(super) type Given = IndexMap<String, String>;

type Find<'a> = dyn Fn(&str) -> Option<ArrayRef> + 'a;

/// A list of objects, and the name of its item in paths; without a name, the keys of the item alone.
#[derive(Clone, Debug)]
pub(super) struct List {
    pub(super) key: String,
    pub(super) item: String,
}

#[derive(Clone, Debug)]
enum Source {
    Constant(Value),
    /// A text of several values: literal parts, each before a value, and the last literal.
    Text(Vec<(String, Path)>, String),
    Value(Path, Change),
    /// The position within the episode, by an integer or by the order of rows.
    Order(Option<Path>),
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Change {
    from: Option<String>,
    value: Option<Value>,
    start: Option<i64>,
    scale: Option<f64>,
    /// True to take the nearest integer.
    round: bool,
    /// The unit of the scaled numbers, for readers of the file.
    unit: Option<String>,
    words: IndexMap<String, Value>,
}

/// The path to a value in a row: keys and positions separated by dots, and an integer to add to the value.
#[derive(Clone, Debug)]
struct Path {
    keys: String,
    added: i64,
}

/// How the steps of an episode are ordered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Order {
    /// By their number `t`.
    #[default]
    Numbers,
    /// By an integer, with any gaps.
    Column,
    Rows,
}

/// A mapping that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: expected {expected}, found {found}")]
pub struct MappingError {
    place: String,
    expected: &'static str,
    found: String,
}

impl MappingError {
    fn of_file(place: String, found: &str) -> Self {
        Self { place, expected: "a format, or a mapping file with `[import]`", found: found.trim_end().into() }
    }
}

impl Mapping {
    /// The mapping in this file, or else this one, with columns from `COLUMN=PATH` and constants from `COLUMN=VALUE`.
    pub fn parse(
        file: Option<&FilePath>,
        other: Option<Self>,
        columns: &[String],
        constants: &[String],
    ) -> Result<Self, MappingError> {
        let mut mapping = file.map(Self::read).transpose()?.or(other).unwrap_or_default();
        for typed in columns {
            let (name, path) = pair(typed, "COLUMN=PATH")?;
            mapping.columns.insert(name.clone(), Source::Value(Path::parse(&path), Change::default()));
            mapping.settings.columns.insert(name, path.into());
        }
        for typed in constants {
            let (name, text) = pair(typed, "COLUMN=VALUE")?;
            let value = constant(&name, text);
            mapping.columns.insert(name.clone(), Source::Constant(value.clone()));
            mapping.settings.columns.insert(name, value);
        }
        Ok(mapping)
    }

    /// The mapping in the text of a definition file; `None` without the table `[import]`. What else is wrong with the file
    /// is left to the reader of definitions.
    pub fn of_definitions(path: &FilePath, text: &str) -> Result<Option<Self>, MappingError> {
        let has_one = toml::from_str::<toml::Table>(text).is_ok_and(|file| file.contains_key("import"));
        let read = || Self::of_text(text).map_err(|found| MappingError::of_file(Input::new(path).name, &found));
        has_one.then(|| Ok(Self { is_of_definitions: true, ..read()? })).transpose()
    }

    fn read(path: &FilePath) -> Result<Self, MappingError> {
        let text = input::text(path, LARGEST_FILE).map_err(|error| error.to_string());
        text.and_then(|text| Self::of_text(&text))
            .map_err(|found| MappingError::of_file(format!("--from {}", Input::new(path).name), &found))
    }

    pub(super) fn built_in(text: &str) -> Self {
        let mapping = Self::of_text(text).expect("the tests read every mapping in `assets/import`");
        Self { is_built_in: true, ..mapping }
    }

    fn of_text(text: &str) -> Result<Self, String> {
        let MappingFile { import: settings } = toml::from_str(text).map_err(|error| error.to_string())?;
        let is_optional = |name: &String| column(name).is_some_and(|column| column.is_of_some_tasks);
        if let Some(name) = settings.absent.iter().find(|name| !is_optional(name)) {
            return Err(format!("`absent` with `{name}`, which every trace has"));
        }
        let known = |name: &String| Format::named(name).ok_or_else(|| format!("the unknown format `{name}`"));
        let column = |(name, entry): (&String, &Value)| {
            let source = Source::of(entry).map_err(|found| format!("{found} for the column `{name}`"))?;
            Ok::<_, String>((name.clone(), source))
        };
        Ok(Self {
            format: settings.format.as_ref().map(known).transpose()?,
            lists: List::all(&settings.rows)?,
            columns: settings.columns.iter().map(column).collect::<Result<_, _>>()?,
            settings,
            ..Self::default()
        })
    }

    /// This mapping on top of another one.
    pub(super) fn over(&self, mut other: Self) -> Self {
        other.settings.absent.retain(|name| !self.columns.contains_key(name));
        other.columns.extend(self.columns.clone());
        other
    }

    /// Returns true if a file of this format is not the kind that the mapping of some definitions is for.
    pub(super) fn is_for_another(&self, found: Format) -> bool {
        self.is_of_definitions && self.format.is_some_and(|format| format.is_recognised() && format != found)
    }

    pub fn is_empty(&self) -> bool {
        self.columns.is_empty() && self.lists.is_empty()
    }

    /// The entries for the footer of a trace, as they were written.
    pub(super) fn declared(&self) -> Value {
        let is_constant = |name: &str| matches!(self.columns.get(name), Some(Source::Constant(_)));
        let entries = self.settings.columns.clone().into_iter();
        let (set, map): (Map<String, Value>, Map<_, _>) = entries.partition(|(name, _)| is_constant(name));
        json!({ "map": map, "set": set })
    }

    pub(super) fn order(&self) -> Order {
        match self.columns.get("t") {
            Some(Source::Order(Some(_))) => Order::Column,
            Some(Source::Order(None)) => Order::Rows,
            _ => Order::Numbers,
        }
    }

    pub(super) fn reads(&self, keys: &str) -> bool {
        self.paths().any(|path| path == keys || is_within(path, keys))
    }

    /// The parts of a file's path that the pattern names.
    pub(super) fn parts_of_path(&self, path: &str) -> Given {
        let part = |(pattern, part): (&str, &str)| {
            let (before, rest) = pattern.split_once('{')?;
            let (name, after) = rest.split_once('}')?;
            Some((name.to_owned(), part.strip_prefix(before)?.strip_suffix(after)?.to_owned()))
        };
        self.settings.path.rsplit('/').zip(path.rsplit('/')).filter_map(part).collect()
    }

    /// The paths of all values that columns are made of.
    pub(super) fn paths(&self) -> impl Iterator<Item = &str> {
        self.columns.values().flat_map(Source::paths).map(|path| path.keys.as_str())
    }

    /// The rows of a table as steps. Errors: a column with a value that has no text.
    pub(super) fn apply(&self, table: &RecordBatch, given: &Given) -> Result<RecordBatch, (String, Unreadable)> {
        let (rows, mut columns) = (table.num_rows(), Vec::new());
        let find = |key: &str| {
            let given = || Some(array(vec![Cell::Spelled(given.get(key)?.into()); rows]));
            table.column_by_name(key).cloned().or_else(given)
        };
        let is_constant = |source: &Source| matches!(source, Source::Constant(_));
        for (name, source) in self.columns.iter().filter(|(_, source)| !is_constant(source)) {
            let values = source.column(name, rows, &find).map_err(|error| (name.clone(), error))?;
            match values {
                None if self.is_built_in => {}
                None => columns.push((name.clone(), new_null_array(&DataType::Null, rows))),
                Some(values) => columns.push((name.clone(), values)),
            }
        }
        for (field, values) in table.schema_ref().fields().iter().zip(table.columns()) {
            let is_left = self.is_empty() || !values.data_type().is_nested();
            if is_left && !self.takes(field.name()) {
                columns.push((field.name().clone(), plain(values).map_err(|error| (field.name().clone(), error))?));
            }
        }
        for (name, source) in &self.columns {
            if let Source::Constant(value) = source {
                columns.push((name.clone(), array(vec![Cell::of_json(value); rows])));
            }
        }
        let may_be_null = |name: &&String| column(name).is_some_and(|column| column.nullable);
        for name in self.settings.absent.iter().filter(may_be_null) {
            columns.push((name.clone(), new_null_array(&DataType::Null, rows)));
        }
        Ok(arrays::table(columns, rows))
    }

    /// Returns true if an entry takes the value of this key, or another value takes its name.
    fn takes(&self, key: &str) -> bool {
        // A part of a text is also a column of its own, and the numbers of a format stay beside those that count from 1.
        let is_left = |source: &Source, path: &Path| match source {
            Source::Text(..) => true,
            _ => self.is_built_in && path.added != 0,
        };
        let is_nested = key.contains(['.', '#']);
        let takes =
            |source: &Source| source.paths().any(|path| path.keys == key && (is_nested || !is_left(source, path)));
        self.columns.iter().any(|(name, source)| name == key || takes(source))
    }
}

impl List {
    /// The lists in a text such as `samples[sample].epochs[]`.
    fn all(text: &str) -> Result<Vec<Self>, String> {
        let list = |part: &str| {
            let (key, item) = part.trim_start_matches('.').split_once('[')?;
            Some(Self { key: key.to_owned(), item: item.to_owned() })
        };
        let parts = text.split_inclusive(']').map(|part| list(part.strip_suffix(']')?));
        parts.collect::<Option<_>>().ok_or_else(|| format!("`rows = \"{text}\"`, which is not of the form `steps[]`"))
    }
}

impl Source {
    fn of(entry: &Value) -> Result<Self, String> {
        let change: Change = match entry {
            Value::String(text) if text.contains('{') => return Self::text(text),
            Value::String(path) => Change { from: Some(path.clone()), ..Change::default() },
            Value::Object(_) => serde_json::from_value(entry.clone()).map_err(|error| error.to_string())?,
            constant => return Ok(Self::Constant(constant.clone())),
        };
        match change {
            Change { value: Some(value), from: None, .. } => Ok(Self::Constant(value)),
            Change { from, start: Some(1), .. } => Ok(Self::Order(from.as_deref().map(Path::parse))),
            Change { start: Some(_), .. } => Err("another `start` than 1, with which every trace begins,".to_owned()),
            Change { from: Some(ref from), .. } => Ok(Self::Value(Path::parse(from), change)),
            Change { .. } => Err("neither `from` nor `value`".to_owned()),
        }
    }

    /// A text such as `{policy}/{task}`.
    fn text(text: &str) -> Result<Self, String> {
        let (mut parts, mut rest) = (Vec::new(), text);
        while let Some((literal, after)) = rest.split_once('{') {
            let (path, after) = after.split_once('}').ok_or("a `{` without `}`")?;
            parts.push((literal.to_owned(), Path::parse(path)));
            rest = after;
        }
        Ok(Self::Text(parts, rest.to_owned()))
    }

    fn paths(&self) -> impl Iterator<Item = &Path> {
        let (one, several) = match self {
            Self::Constant(_) | Self::Order(None) => (None, &[][..]),
            Self::Value(path, _) | Self::Order(Some(path)) => (Some(path), &[][..]),
            Self::Text(parts, _) => (None, parts.as_slice()),
        };
        one.into_iter().chain(several.iter().map(|(_, path)| path))
    }

    fn column(&self, name: &str, rows: usize, find: &Find<'_>) -> Result<Option<ArrayRef>, Unreadable> {
        let cells = |path: &Path, change: &dyn Fn(Cell<'_>) -> Cell<'static>| {
            let found = path.column(find)?;
            Ok(found.map(|values| array((0..values.len()).map(|row| change(Cell::at(&values, row))))))
        };
        match self {
            Self::Constant(_) => Ok(None),
            Self::Order(None) => Ok(Some(Arc::new(Int64Array::from(vec![1; rows])))),
            Self::Order(Some(path)) => cells(path, &|cell| path.finished(name, cell.typed(Kind::Int))),
            Self::Value(path, change) if change.is_none() && path.added == 0 && !is_general_text(name) => {
                path.column(find)
            }
            Self::Value(path, change) => cells(path, &|cell| path.finished(name, change.of(&cell))),
            Self::Text(parts, end) => {
                let columns = parts.iter().map(|(_, path)| path.column(find)).collect::<Result<Vec<_>, _>>()?;
                let text = |row| {
                    let value = |((literal, path), column): (&(String, Path), &Option<ArrayRef>)| {
                        Some(format!("{literal}{}", path.added(Cell::at(column.as_ref()?, row)).text()?))
                    };
                    Some(parts.iter().zip(&columns).map(value).collect::<Option<String>>()? + end)
                };
                Ok(Some(Arc::new((0..rows).map(text).collect::<StringArray>())))
            }
        }
    }
}

impl Change {
    fn is_none(&self) -> bool {
        self.scale.is_none() && !self.round && self.words.is_empty()
    }

    /// The value of a word, in another unit: an integer if dividing by the factor gives the number again, or if the mapping
    /// rounds.
    #[expect(clippy::float_cmp, reason = "that is the question")]
    fn of<'a>(&'a self, cell: &Cell<'a>) -> Cell<'a> {
        let word = cell.text().and_then(|text| self.words.get(&*text));
        let cell = word.map_or_else(|| cell.clone(), Cell::of_json);
        let number = cell.clone().typed(Kind::Float).float();
        let Some((factor, number)) = self.scale.or(self.round.then_some(1.0)).zip(number) else { return cell };
        let product = (number * factor).round();
        if self.round || product / factor == number {
            Cell::Float(product).typed(Kind::Int)
        } else {
            Cell::Float(number * factor)
        }
    }
}

impl Path {
    fn parse(text: &str) -> Self {
        match text.rsplit_once('+').map(|(keys, added)| (keys, added.parse())) {
            Some((keys, Ok(added))) => Self { keys: keys.to_owned(), added },
            _ => Self { keys: text.to_owned(), added: 0 },
        }
    }

    fn column(&self, find: &Find<'_>) -> Result<Option<ArrayRef>, Unreadable> {
        within(find, &self.keys).map(|values| plain(&values)).transpose()
    }

    /// The value with the number added. A number becomes text in columns that are text in every domain.
    fn finished(&self, name: &str, found: Cell<'_>) -> Cell<'static> {
        let value = self.added(found).into_owned();
        match &value {
            Cell::Unheld(_) | Cell::Int(_) | Cell::Float(_) if is_general_text(name) => {
                Cell::Text(value.text().unwrap_or_default().into_owned().into())
            }
            _ => value,
        }
    }

    fn added<'a>(&self, found: Cell<'a>) -> Cell<'a> {
        match found.clone().typed(Kind::Int) {
            Cell::Int(number) if self.added != 0 => {
                let sum = i128::from(number) + i128::from(self.added);
                i64::try_from(sum).map_or_else(|_| Cell::Unheld(sum.to_string().into()), Cell::Int)
            }
            _ => found,
        }
    }
}

fn is_general_text(name: &str) -> bool {
    is_general(name) && column(name).is_some_and(|column| column.stored.kind() == Kind::String)
}

fn is_within(path: &str, key: &str) -> bool {
    path.strip_prefix(key).is_some_and(|rest| rest.starts_with(['.', '[']))
}

impl Node for &Value {
    fn member(&self, key: &str) -> Option<Self> {
        self.as_object()?.get(key)
    }

    fn item(&self, position: usize) -> Option<Self> {
        self.as_array()?.get(position)
    }
}

pub(super) fn at<N: Node>(node: N, path: &str) -> Option<N> {
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
    let place = format!("`{}`", visible(typed));
    let fault = |found: &str| MappingError { place: place.clone(), expected, found: found.to_owned() };
    let (name, text) = typed.split_once('=').ok_or_else(|| fault("no `=`"))?;
    if name.is_empty() || text.is_empty() {
        return Err(fault("nothing on one side of `=`"));
    }
    Ok((name.to_owned(), text.to_owned()))
}

fn constant(name: &str, text: String) -> Value {
    let is_text = column(name).is_some_and(|column| column.stored.kind() == Kind::String);
    let scalar = serde_json::from_str(&marked(&text))
        .ok()
        .filter(|value: &Value| !(is_text || value.is_array() || value.is_object()));
    scalar.unwrap_or(Value::String(text))
}
