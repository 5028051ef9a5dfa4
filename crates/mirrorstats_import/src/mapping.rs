//! Makes steps of rows of any shape: columns by paths, texts of several values, constants, order.
//!
//! A mapping is data: a file of a user or one in `assets/import`, and `--map` and `--set` on top of it.

use std::path::Path as FilePath;

use arrow::array::{RecordBatch, new_null_array};
use arrow::datatypes::DataType;
use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::arrays::{self, Unreadable, plain, repeated};
use super::format::Format;
use super::json::marked;
use super::source::{Path, Pattern, Source};
use super::value::Cell;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::input;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::schema::{Kind, column};

const LARGEST_FILE: Limit = Limit::new("bytes of a mapping file", 1 << 20);

#[derive(Clone, Debug, Default)]
pub struct Mapping {
    pub format: Option<Format>,
    /// The lists that hold the rows of an object, from the outside.
    pub(super) lists: Vec<List>,
    /// The path of a file beside the log with the steps of a row.
    pub(super) steps: Option<Pattern>,
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
    /// A pattern of the path from the folder of the file to JSON Lines with the steps of a row.
    steps: Option<String>,
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

/// A list of objects, and the name of its item in paths; without a name, the keys of the item alone.
#[derive(Clone, Debug)]
pub(super) struct List {
    pub(super) key: String,
    pub(super) item: String,
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
            mapping.columns.insert(name.clone(), Source::path(&path));
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
            steps: settings.steps.as_deref().map(Pattern::parse).transpose()?,
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
            let given = || Some(repeated(Cell::Spelled(given.get(key)?.into()), rows));
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
                columns.push((name.clone(), repeated(Cell::of_json(value), rows)));
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

fn is_within(path: &str, key: &str) -> bool {
    path.strip_prefix(key).is_some_and(|rest| rest.starts_with(['.', '[']))
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
