//! Decodes the rows of an episode to the episode that was written: the inverse of writing.
//!
//! Columns of the schema that the file does not have are absent; columns outside the schema are not read.

use arrow::array::{Array as _, ArrayRef, AsArray as _, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use arrow::util::display::{ArrayFormatter, FormatOptions};

use crate::episodes::answers::{self, Answered};
use crate::episodes::episode::{Episode, Step};
use crate::schema::domain::is_identity;
use crate::schema::{COLUMNS, Column, Kind, Value, value_at};

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column `{column}`: expected {expected}, found {found}")]
pub struct NotAnEpisode {
    column: String,
    expected: String,
    found: String,
}

/// The episode in these rows, which must belong to one episode.
pub(crate) fn episode(rows: &RecordBatch) -> Result<Episode, NotAnEpisode> {
    let mut episode = Episode { steps: vec![Step::default(); rows.num_rows()], ..Episode::default() };
    for column in COLUMNS.iter() {
        match rows.column_by_name(column.name) {
            Some(values) => fill(&mut episode, column, values)?,
            None if column.required && !column.is_of_some_tasks => {
                return Err(fault(column, "the column", "none"));
            }
            None => {}
        }
    }
    let schema = rows.schema();
    let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
    for name in answers::among(&names) {
        let values = rows.column_by_name(name).and_then(held);
        for (step, row) in episode.steps.iter_mut().zip(0..) {
            let answered = values.as_ref().and_then(|values| Answered::from_value(value_at(values, row)?));
            step.extra.answers.extend(answered.map(|answered| (name.to_owned(), answered)));
        }
    }
    Ok(episode)
}

/// A column as one of the four displayed types; `None` if it cannot be converted.
fn held(values: &ArrayRef) -> Option<ArrayRef> {
    let held = match values.data_type() {
        DataType::Boolean => DataType::Boolean,
        integer if integer.is_integer() => DataType::Int64,
        float if float.is_floating() => DataType::Float64,
        _ => DataType::Utf8,
    };
    cast(values, &held).ok()
}

/// A column of an episode as the file stores it.
#[derive(Clone, Debug)]
pub struct OwnColumn {
    pub name: String,
    values: ArrayRef,
}

/// A truth value, or any other value as text without loss.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Displayed {
    Bool(bool),
    Text(String),
}

impl OwnColumn {
    /// Returns true if the column has integers, floats or decimals.
    pub fn is_numeric(&self) -> bool {
        self.values.data_type().is_numeric()
    }

    pub fn values(&self) -> impl Iterator<Item = Option<Displayed>> {
        let formatter = ArrayFormatter::try_new(&self.values, &OPTIONS).map_err(|error| error.to_string());
        let nulls = self.values.logical_nulls();
        let is_float = self.values.data_type().is_floating();
        let shown = move |row| match (self.values.as_boolean_opt(), &formatter) {
            (Some(truths), _) => Displayed::Bool(truths.value(row)),
            (None, Ok(formatter)) => {
                let text = formatter.value(row).to_string();
                let whole = if is_float { text.strip_suffix(".0") } else { None };
                Displayed::Text(whole.map_or_else(|| text.clone(), str::to_owned))
            }
            (None, Err(error)) => Displayed::Text(error.clone()),
        };
        (0..self.values.len())
            .map(move |row| nulls.as_ref().is_none_or(|nulls| nulls.is_valid(row)).then(|| shown(row)))
    }
}

const OPTIONS: FormatOptions<'static> = FormatOptions::new();

pub(crate) fn identity(rows: &RecordBatch) -> Result<Episode, NotAnEpisode> {
    let mut episode = Episode { steps: vec![Step::default(); rows.num_rows()], ..Episode::default() };
    for column in COLUMNS.iter().filter(|column| is_identity(column.name)) {
        let values = rows.column_by_name(column.name).ok_or_else(|| fault(column, "the column", "none"))?;
        fill(&mut episode, column, values)?;
    }
    Ok(episode)
}

pub(crate) fn own_columns(rows: &RecordBatch) -> Vec<OwnColumn> {
    let schema = rows.schema();
    let named = schema.fields().iter().zip(rows.columns()).filter(|(field, _)| !is_identity(field.name()));
    named.map(|(field, values)| OwnColumn { name: field.name().clone(), values: values.clone() }).collect()
}

fn fill(episode: &mut Episode, column: &Column, values: &ArrayRef) -> Result<(), NotAnEpisode> {
    let (stored, held) = (column.stored.data_type(), column.stored.kind().data_type());
    let values = cast(values, &stored).and_then(|values| cast(&values, &held));
    let values = values.map_err(|error| fault(column, &stored.to_string(), &error.to_string()))?;
    let rows = if column.constant { values.len().min(1) } else { values.len() };
    for row in 0..rows {
        let value = value_at(&values, row);
        if !column.put(episode, row, value) {
            return Err(misfit(column, value));
        }
    }
    Ok(())
}

fn misfit(column: &Column, value: Option<Value<'_>>) -> NotAnEpisode {
    match (value, column.stored.kind()) {
        (Some(Value::Text(name)), _) => fault(column, "a known action", name),
        (_, Kind::Bool) => fault(column, "true or false", "null"),
        (_, Kind::Int) => fault(column, "an integer", "none"),
        _ => fault(column, "a value", "none"),
    }
}

fn fault(column: &Column, expected: &str, found: &str) -> NotAnEpisode {
    NotAnEpisode { column: column.name.to_owned(), expected: expected.to_owned(), found: found.to_owned() }
}
