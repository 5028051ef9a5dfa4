//! The source of a column in the rows of another program: a path, a text of several values, a constant or an order.

use std::sync::Arc;

use arrow::array::{ArrayRef, Int64Array, StringArray};
use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::Value;

use super::arrays::{Node, Unreadable, array, plain, repeated};
use super::value::Cell;
use mirrorstats_trace::schema::domain::is_general;
use mirrorstats_trace::schema::{Kind, column};

pub(super) type Find<'a> = dyn Fn(&str) -> Option<ArrayRef> + 'a;

#[derive(Clone, Debug)]
pub(super) enum Source {
    Constant(Value),
    Text(Pattern),
    Value(Path, Box<Change>),
    /// The position within the episode, by an integer or by the order of rows.
    Order(Option<Path>),
}

/// A text of several values such as `{policy}/{task}`: literal parts, each before a value, and the last literal.
#[derive(Clone, Debug)]
pub(super) struct Pattern {
    parts: Vec<(String, Path)>,
    end: String,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Change {
    from: Option<String>,
    value: Option<Value>,
    /// The value of rows that have none.
    or: Option<Value>,
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
pub(super) struct Path {
    pub(super) keys: String,
    pub(super) added: i64,
}

impl Source {
    pub(super) fn of(entry: &Value) -> Result<Self, String> {
        let change: Change = match entry {
            Value::String(text) if text.contains('{') => return Pattern::parse(text).map(Self::Text),
            Value::String(path) => return Ok(Self::path(path)),
            Value::Object(_) => serde_json::from_value(entry.clone()).map_err(|error| error.to_string())?,
            constant => return Ok(Self::Constant(constant.clone())),
        };
        match change {
            Change { value: Some(value), from: None, .. } => Ok(Self::Constant(value)),
            Change { from, start: Some(1), .. } => Ok(Self::Order(from.as_deref().map(Path::parse))),
            Change { start: Some(_), .. } => Err("another `start` than 1, with which every trace begins,".to_owned()),
            Change { from: Some(ref from), .. } => Ok(Self::Value(Path::parse(from), Box::new(change))),
            Change { .. } => Err("neither `from` nor `value`".to_owned()),
        }
    }

    pub(super) fn path(keys: &str) -> Self {
        Self::Value(Path::parse(keys), Box::default())
    }

    pub(super) fn paths(&self) -> impl Iterator<Item = &Path> {
        let (one, several) = match self {
            Self::Constant(_) | Self::Order(None) => (None, None),
            Self::Value(path, _) | Self::Order(Some(path)) => (Some(path), None),
            Self::Text(pattern) => (None, Some(pattern.paths())),
        };
        one.into_iter().chain(several.into_iter().flatten())
    }

    /// The column of this name; `None` if the table lacks it.
    pub(super) fn column(&self, name: &str, rows: usize, find: &Find<'_>) -> Result<Option<ArrayRef>, Unreadable> {
        let cells = |values: ArrayRef, change: &dyn Fn(Cell<'_>) -> Cell<'static>| {
            array((0..values.len()).map(|row| change(Cell::at(&values, row))))
        };
        match self {
            Self::Constant(value) => Ok(Some(repeated(Cell::of_json(value), rows))),
            Self::Order(None) => Ok(Some(Arc::new(Int64Array::from(vec![1; rows])))),
            Self::Order(Some(path)) => {
                let numbers = |cell: Cell<'_>| path.finished(name, cell.typed(Kind::Int));
                Ok(path.column(find)?.map(|values| cells(values, &numbers)))
            }
            Self::Value(path, change) if change.is_none() && path.added == 0 && !is_general_text(name) => {
                path.column(find)
            }
            Self::Value(path, change) => {
                let other = change.or.as_ref().map(Cell::of_json);
                let value = |cell: Cell<'_>| match &other {
                    Some(other) if cell == Cell::Null => other.clone().into_owned(),
                    _ => path.finished(name, change.of(&cell)),
                };
                let found = path.column(find)?;
                let absent = || other.clone().map(|other| repeated(other, rows));
                Ok(found.map(|values| cells(values, &value)).or_else(absent))
            }
            Self::Text(pattern) => {
                let columns = pattern.paths().map(|path| path.column(find)).collect::<Result<Vec<_>, _>>()?;
                let text =
                    |row| pattern.filled(columns.iter().map_while(|values| Some(Cell::at(values.as_ref()?, row))));
                Ok(Some(Arc::new((0..rows).map(text).collect::<StringArray>())))
            }
        }
    }
}

impl Pattern {
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let (mut parts, mut rest) = (Vec::new(), text);
        while let Some((literal, after)) = rest.split_once('{') {
            let (path, after) = after.split_once('}').ok_or("a `{` without `}`")?;
            parts.push((literal.to_owned(), Path::parse(path)));
            rest = after;
        }
        Ok(Self { parts, end: rest.to_owned() })
    }

    pub(super) fn paths(&self) -> impl Iterator<Item = &Path> {
        self.parts.iter().map(|(_, path)| path)
    }

    /// The text with the values of its paths, in their order; `None` if one of them is missing.
    pub(super) fn filled<'v>(&self, mut values: impl Iterator<Item = Cell<'v>>) -> Option<String> {
        let part = |(literal, path): &(String, Path)| Some(format!("{literal}{}", path.added(values.next()?).text()?));
        Some(self.parts.iter().map(part).collect::<Option<String>>()? + &self.end)
    }
}

impl Change {
    fn is_none(&self) -> bool {
        self.scale.is_none() && !self.round && self.words.is_empty() && self.or.is_none()
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
