//! Answers that an experiment declares: `answer` in its footer, and two columns for each.
//!
//! A key `side` has the columns `answer_side`, from the reply, and `truth_side`, the right answer. Both are text, or
//! numbers if the answer is a number.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use crate::schema::{Column, DeclaredColumn, Kind, Scope, Stored, Value};

/// The prefixes of the column names: of the answer, and of its truth.
pub const PREFIXES: [&str; 2] = ["answer_", "truth_"];

pub const MOST_ANSWERS: usize = 8;

/// The most answer columns that a process remembers, so that hostile footers cannot fill its memory.
const MOST_COLUMNS: usize = 4096;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Answered {
    Number(f64),
    Text(String),
}

impl Answered {
    pub(crate) fn value(&self) -> Value<'_> {
        match self {
            Self::Number(number) => Value::Float(*number),
            Self::Text(text) => Value::Text(text),
        }
    }

    pub(crate) const fn kind(&self) -> Kind {
        match self {
            Self::Number(_) => Kind::Float,
            Self::Text(_) => Kind::String,
        }
    }

    pub(crate) fn from_value(value: Value<'_>) -> Option<Self> {
        match value {
            Value::Text(text) => Some(Self::Text(text.to_owned())),
            Value::Float(number) => Some(Self::Number(number)),
            Value::Bool(_) | Value::Int(_) => None,
        }
    }

    pub fn text(&self) -> String {
        match self {
            Self::Number(number) => number.to_string(),
            Self::Text(text) => text.clone(),
        }
    }
}

pub fn columns_of(key: &str) -> [String; 2] {
    PREFIXES.map(|prefix| format!("{prefix}{key}"))
}

pub fn is_answer(name: &str) -> bool {
    // `answer_truth` belongs to the schema.
    PREFIXES.iter().any(|prefix| name.starts_with(prefix)) && crate::schema::column(name).is_none()
}

/// The answer columns among these: those of keys with both columns, in order.
pub(crate) fn among<'a>(names: &[&'a str]) -> Vec<&'a str> {
    let has_both = |name: &str| {
        let key = PREFIXES.iter().find_map(|prefix| name.strip_prefix(prefix));
        key.is_some_and(|key| columns_of(key).iter().all(|column| names.contains(&column.as_str())))
    };
    names.iter().copied().filter(|name| is_answer(name) && has_both(name)).collect()
}

/// The columns of the answers that an experiment declares, each with its allowed texts. Invalid entries are left out.
pub(crate) fn declared(experiment: &Json) -> Vec<DeclaredColumn> {
    let answers = experiment["answer"].as_array().into_iter().flatten().take(MOST_ANSWERS);
    let columns = answers.filter_map(|answer| {
        let is_number = answer["type"] == "number";
        let texts = |list: &Json| -> Vec<String> {
            list.as_array().into_iter().flatten().filter_map(|text| text.as_str().map(str::to_owned)).collect()
        };
        let mut values = if answer["type"] == "yes_no" {
            ["yes", "no"].map(str::to_owned).to_vec()
        } else {
            texts(&answer["options"])
        };
        if answer["unknown"] == true && !values.is_empty() {
            values.push("unknown".to_owned());
        }
        let kind = if is_number { Kind::Float } else { Kind::String };
        let column = move |name| DeclaredColumn { name, kind, values: values.clone(), constant: false };
        Some(columns_of(answer["key"].as_str()?).map(column))
    });
    columns.flatten().filter(|column| is_answer(&column.name)).collect()
}

pub(crate) fn columns(experiment: &Json) -> Vec<&'static Column> {
    declared(experiment).iter().filter_map(|column| known(&column.name, column.kind)).collect()
}

/// The column of a name and a type, kept until the process ends; `None` if there are too many.
pub(crate) fn known(name: &str, kind: Kind) -> Option<&'static Column> {
    static KNOWN: LazyLock<Mutex<HashMap<(String, Kind), &'static Column>>> = LazyLock::new(Mutex::default);
    let mut all = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let key = (name.to_owned(), kind);
    if let Some(column) = all.get(&key) {
        return Some(column);
    }
    if all.len() >= MOST_COLUMNS {
        return None;
    }
    let stored = if kind == Kind::Float { Stored::Float64 } else { Stored::String };
    let doc = "An answer that the experiment declares, or what it should be.";
    let name: &'static str = name.to_owned().leak();
    let column = Column { name, stored, nullable: true, doc, scope: Scope::Any, ..Column::default() };
    let column: &'static Column = Box::leak(Box::new(column));
    all.insert(key, column);
    Some(column)
}
