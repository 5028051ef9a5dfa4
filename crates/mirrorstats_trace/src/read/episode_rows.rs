//! Whole episodes of a trace file, each with all of its columns as the file stores them.

use std::error::Error;
use std::fs::File;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, AsArray, RecordBatch};
use arrow::compute::{cast, concat_batches};
use arrow::datatypes::{DataType, Int64Type};
use arrow::util::display::{ArrayFormatter, FormatOptions};
use parquet::arrow::arrow_reader::{RowSelection, RowSelector};

use super::budget::{most_shown, most_values};
use super::flat::{check_flat, rows_of_part};
use super::footer::{Extent, Footer, footer};
use crate::catch_panic::contained;
use crate::diagnostic::Finding;
use crate::episodes::answers::{self, Answered};
use crate::episodes::episode::{Episode, Step};
use crate::episodes::episode_hash::EPISODE_HASH;
use crate::error::TraceError;
use crate::inputs::Input;
use crate::schema::domain::is_identity;
use crate::schema::{COLUMNS, Column, Kind, Value, value_at};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_parquet_pages::rows_of;

#[derive(Clone, Debug)]
pub struct EpisodeRows {
    pub episode_id: String,
    pub seed: i64,
    pub run: i64,
    pub repetition: i64,
    pub(crate) rows: RecordBatch,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("column `{column}`: expected {expected}, found {found}")]
pub struct NotAnEpisode {
    column: String,
    expected: String,
    found: String,
}

impl EpisodeRows {
    pub fn len(&self) -> usize {
        self.rows.num_rows()
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The episode that was written. Columns outside the schema are not read, except answers.
    pub fn episode(&self) -> Result<Episode, NotAnEpisode> {
        let is_needed = |column: &Column| column.required && !column.is_of_some_tasks;
        let mut episode = self.decoded(COLUMNS.iter(), is_needed)?;
        let schema = self.rows.schema();
        let names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
        for name in answers::among(&names) {
            let values = self.rows.column_by_name(name).and_then(widest);
            for (step, row) in episode.steps.iter_mut().zip(0..) {
                let answered = values.as_ref().and_then(|values| Answered::from_value(value_at(values, row)?));
                step.extra.answers.extend(answered.map(|answered| (name.to_owned(), answered)));
            }
        }
        Ok(episode)
    }

    /// The identity of an episode of any domain; its steps have no values.
    pub fn identity(&self) -> Result<Episode, NotAnEpisode> {
        self.decoded(COLUMNS.iter().filter(|column| is_identity(column.name)), |_| true)
    }

    fn decoded(
        &self,
        columns: impl Iterator<Item = &'static Column>,
        is_needed: impl Fn(&Column) -> bool,
    ) -> Result<Episode, NotAnEpisode> {
        let mut episode = Episode { steps: vec![Step::default(); self.len()], ..Episode::default() };
        for column in columns {
            match self.rows.column_by_name(column.name) {
                Some(values) => fill(&mut episode, column, values)?,
                None if is_needed(column) => return Err(fault(column, "the column", "none")),
                None => {}
            }
        }
        Ok(episode)
    }

    pub fn own_columns(&self) -> Vec<OwnColumn> {
        let schema = self.rows.schema();
        let named = schema.fields().iter().zip(self.rows.columns()).filter(|(field, _)| !is_identity(field.name()));
        named.map(|(field, values)| OwnColumn { name: field.name().clone(), values: values.clone() }).collect()
    }

    pub fn stated_hash(&self) -> Option<String> {
        let hashes = cast(self.rows.column_by_name(EPISODE_HASH)?, &DataType::Utf8).ok()?;
        let first = hashes.as_string::<i32>().iter().next().flatten();
        first.map(str::to_owned)
    }
}

fn widest(values: &ArrayRef) -> Option<ArrayRef> {
    let widest = match values.data_type() {
        DataType::Boolean => Kind::Bool,
        integer if integer.is_integer() => Kind::Int,
        float if float.is_floating() => Kind::Float,
        _ => Kind::String,
    };
    cast(values, &widest.data_type()).ok()
}

fn fill(episode: &mut Episode, column: &Column, values: &ArrayRef) -> Result<(), NotAnEpisode> {
    let (stored, widest) = (column.stored.data_type(), column.stored.kind().data_type());
    let values = cast(values, &stored).and_then(|values| cast(&values, &widest));
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
    pub fn is_numeric(&self) -> bool {
        self.values.data_type().is_numeric()
    }

    pub fn values(&self) -> impl Iterator<Item = Option<Displayed>> {
        const OPTIONS: FormatOptions<'static> = FormatOptions::new();
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

/// All episodes of a trace file, which may have no rows.
pub fn read(path: &Path) -> Result<Vec<EpisodeRows>, TraceError> {
    let name = path.display().to_string();
    let (file, footer) = opened(&name, &Input::new(path))?;
    let row_groups = (0..footer.metadata.num_row_groups()).collect();
    decode(&name, file, footer, row_groups, None)
}

/// The episodes in some rows of a trace file, counted from its first row. Only the row groups of these rows are read.
/// Values are held row by row, so their number is limited.
pub fn read_rows(of: &Input, rows: Range<usize>) -> Result<Vec<EpisodeRows>, TraceError> {
    let (file, footer) = opened(&of.name, of)?;
    let columns = footer.metadata.file_metadata().schema_descr().num_columns();
    most_values(footer.bytes)
        .check((rows.len() as u64).saturating_mul(columns as u64))
        .map_err(|exceeded| Finding::over_budget(&of.name, &exceeded))?;
    let (mut before, mut groups, mut skipped) = (0, Vec::new(), None);
    for group in 0..footer.metadata.num_row_groups() {
        let behind = before + rows_of(footer.metadata.row_group(group));
        if behind > rows.start && before < rows.end {
            // If an episode spans several groups, only the first group has rows before it.
            skipped.get_or_insert_with(|| rows.start - before);
            groups.push(group);
        }
        before = behind;
    }
    let selection = vec![RowSelector::skip(skipped.unwrap_or_default()), RowSelector::select(rows.len())];
    let most = most_shown(footer.bytes);
    decode(&of.name, file, footer, groups, Some((selection.into(), most)))
}

fn opened(name: &str, of: &Input) -> Result<(File, Footer), TraceError> {
    let file = input::open(&of.path).map_err(|error| unreadable(name, error))?;
    let footer = footer(of, Extent::Pages).map_err(|finding| unreadable(name, finding.to_string()))?;
    Ok((file, footer))
}

fn decode(
    name: &str,
    file: File,
    Footer { metadata, chunks, .. }: Footer,
    row_groups: Vec<usize>,
    selection: Option<(RowSelection, Limit)>,
) -> Result<Vec<EpisodeRows>, TraceError> {
    let damaged = |finding: Box<Finding>| unreadable(name, finding.to_string());
    check_flat(name, &metadata).map_err(damaged)?;
    let (selection, most) = selection.unzip();
    let rows = rows_of_part(name, file, Arc::new(metadata), chunks, None, row_groups, selection);
    let (mut batches, mut held) = (Vec::new(), 0);
    for batch in rows.map_err(damaged)? {
        let batch = batch.map_err(damaged)?;
        held += batch.get_array_memory_size() as u64;
        let checked = most.map_or(Ok(()), |most| most.check(held));
        checked.map_err(|exceeded| Finding::over_budget(name, &exceeded))?;
        batches.push(batch);
    }
    let Some(first) = batches.first() else { return Ok(Vec::new()) };
    contained(|| concat_batches(&first.schema(), &batches).map_err(|error| error.to_string()))
        .and_then(|rows| split(&rows?))
        .map_err(|fault| unreadable(name, fault))
}

fn unreadable(name: &str, source: impl Into<Box<dyn Error + Send + Sync>>) -> TraceError {
    TraceError::Part { file: name.to_owned(), source: source.into() }
}

fn split(rows: &RecordBatch) -> Result<Vec<EpisodeRows>, String> {
    let column = |name: &str, kind: &DataType| {
        let column = rows.column_by_name(name).ok_or_else(|| format!("there is no column `{name}`"))?;
        cast(column, kind).map_err(|fault| format!("the column `{name}`: {fault}"))
    };
    let ids = column("episode_id", &DataType::Utf8)?;
    let [seeds, runs] = [column("seed", &DataType::Int64)?, column("run", &DataType::Int64)?];
    let (ids, seeds, runs) =
        (ids.as_string::<i32>(), seeds.as_primitive::<Int64Type>(), runs.as_primitive::<Int64Type>());
    let repetitions = column("repetition", &DataType::Int64).ok();
    let repetitions = repetitions.as_ref().map(AsArray::as_primitive::<Int64Type>);
    let mut found = Vec::new();
    let mut start = 0;
    for end in 1..=ids.len() {
        if end == ids.len() || ids.value(end) != ids.value(start) {
            let repetition =
                repetitions.filter(|column| column.is_valid(start)).map_or(1, |column| column.value(start));
            found.push(EpisodeRows {
                episode_id: ids.value(start).to_owned(),
                seed: seeds.value(start),
                run: runs.value(start),
                repetition,
                rows: rows.slice(start, end - start),
            });
            start = end;
        }
    }
    Ok(found)
}
