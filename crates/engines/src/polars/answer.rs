//! A query's rows, written batch by batch: as CSV, JSON lines, Parquet, or the head and tail of a table.
//!
//! Rule: rows come in the order of the query; null and empty stay distinct.

use std::collections::VecDeque;
use std::io::Write;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use polars::prelude::{
    AnyValue, Column, CsvWriter, DataFrame, DataType, Engine, IntoLazy as _, JsonFormat, JsonWriter, LazyFrame,
    ParquetWriter, PlanCallback, PolarsError as Inner, PolarsResult, SerWriter as _,
};
use polars::sql::SQLContext;

use sqlparser::ast::{Query, Value};

use super::rewrite::{self, substitute};
use super::run::{self, PolarsError};
use super::statement::{Asked, Checked, Table};
use toml_spec::Faults;
use trace::catch_panic::contained_on_all_threads;

const BATCH: NonZeroUsize = NonZeroUsize::new(1 << 17).expect("not zero");

#[derive(Debug, thiserror::Error)]
pub enum QueryError {
    #[error(transparent)]
    Faults(#[from] Faults),
    #[error(transparent)]
    Polars(#[from] PolarsError),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated, with a header; null is empty, an empty text is `""`.
    Csv,
    JsonLines,
    Parquet,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Excerpt {
    pub columns: Vec<(String, String)>,
    /// The first rows, `None` for null.
    pub head: Vec<Vec<Option<String>>>,
    pub tail: VecDeque<Vec<Option<String>>>,
    pub rows: usize,
}

pub fn plan(query: &Checked, tables: Vec<(Table, LazyFrame)>) -> Result<LazyFrame, QueryError> {
    let mut context = SQLContext::new();
    let (mut columns, mut schemas) = (Vec::new(), Vec::new());
    for (table, mut frame) in tables {
        let schema = frame.collect_schema().map_err(PolarsError::from)?;
        columns.extend(schema.iter_names().map(polars::prelude::PlSmallStr::to_string));
        schemas.push((table, schema));
        context.register(table.name(), frame);
    }
    let statement = match &query.asked {
        Asked::Tables => return Ok(listed("name", Table::ALL.map(Table::name), None)?),
        Asked::Columns(table) => {
            let found = schemas.iter().find(|(other, _)| other == table).map(|(_, schema)| schema);
            let columns: Vec<(String, &str)> = found
                .into_iter()
                .flat_map(|schema| schema.iter())
                .map(|(name, ty)| (name.to_string(), sql_type(ty)))
                .collect();
            let (names, types): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
            return Ok(listed("column_name", names, Some(types))?);
        }
        Asked::Rows(statement) => {
            let mut statement = statement.as_ref().clone();
            let value = |inner: &Query, asked| {
                scalar(&mut context, inner, asked).map_err(|error| match error {
                    PolarsError::Failed(words) => {
                        query.whole(format!("a subquery runs by itself first: {words}")).into()
                    }
                    other => QueryError::Polars(other),
                })
            };
            substitute(&mut statement, value)?;
            statement
        }
    };
    let planned = run::plan(&mut context, &statement.to_string()).and_then(|mut frame| {
        // Names and types are resolved here, before a row is read.
        contained_on_all_threads(|| frame.collect_schema()).map_err(PolarsError::panicked)??;
        Ok(frame)
    });
    planned.map_err(|error| match error {
        PolarsError::Failed(words) => QueryError::Faults(query.fault(&words, &columns)),
        other => QueryError::Polars(other),
    })
}

fn listed<T: AsRef<str>>(
    name: &str,
    names: impl AsRef<[T]>,
    types: Option<Vec<&str>>,
) -> Result<LazyFrame, PolarsError> {
    let texts: Vec<&str> = names.as_ref().iter().map(AsRef::as_ref).collect();
    let mut columns = vec![Column::new(name.into(), &texts)];
    columns.extend(types.map(|types| Column::new("column_type".into(), types)));
    Ok(DataFrame::new(texts.len(), columns)?.lazy())
}

fn sql_type(ty: &DataType) -> &'static str {
    match ty {
        DataType::Boolean => "BOOLEAN",
        DataType::Int8 => "TINYINT",
        DataType::Int16 => "SMALLINT",
        DataType::Int32 => "INTEGER",
        DataType::Int64 => "BIGINT",
        DataType::UInt32 => "UINTEGER",
        DataType::UInt64 => "UBIGINT",
        DataType::Float32 => "FLOAT",
        DataType::Float64 => "DOUBLE",
        _ => "VARCHAR",
    }
}

/// The value of a subquery: the value of its only row, or null without a row. `EXISTS` gives true if there is a row.
fn scalar(context: &mut SQLContext, query: &Query, asked: rewrite::SubqueryResult) -> Result<Value, PolarsError> {
    let found = run::collect(run::plan(context, &query.to_string())?)?;
    if asked == rewrite::SubqueryResult::Exists {
        return Ok(Value::Boolean(found.height() > 0));
    }
    let (rows, columns) = found.shape();
    if columns != 1 || rows > 1 {
        let words =
            format!("a subquery in the place of a value has {rows} rows of {columns} columns: expected one value");
        return Err(PolarsError::Failed(words));
    }
    if rows == 0 {
        return Ok(Value::Null);
    }
    match found.columns()[0].get(0)? {
        AnyValue::Null => Ok(Value::Null),
        AnyValue::Boolean(value) => Ok(Value::Boolean(value)),
        AnyValue::String(text) => Ok(Value::SingleQuotedString(text.to_owned())),
        AnyValue::StringOwned(text) => Ok(Value::SingleQuotedString(text.to_string())),
        // All digits.
        AnyValue::Float64(value) => Ok(Value::Number(format!("{value:?}"), false)),
        AnyValue::Float32(value) => Ok(Value::Number(format!("{value:?}"), false)),
        value if value.is_integer() => Ok(Value::Number(value.to_string(), false)),
        value => Err(PolarsError::Failed(format!("a subquery has a value that no statement can hold: {value}"))),
    }
}

pub fn write(frame: LazyFrame, format: Format, out: impl Write + Send + 'static) -> Result<(), PolarsError> {
    let mut frame = frame;
    let schema = frame.collect_schema()?;
    match format {
        Format::Csv => {
            let writer = CsvWriter::new(out).batched(&schema)?;
            let writer = each(frame, writer, |writer, batch| Ok(writer.write_batch(&batch)?))?;
            with(writer, |mut writer| Ok(writer.finish()?))
        }
        Format::JsonLines => {
            let writer = each(frame, out, |out, mut batch| {
                Ok(JsonWriter::new(out).with_json_format(JsonFormat::JsonLines).finish(&mut batch)?)
            })?;
            with(writer, |mut out| Ok(out.flush().map_err(Inner::from)?))
        }
        Format::Parquet => {
            let writer = ParquetWriter::new(out).batched(&schema)?;
            let writer = each(frame, writer, |writer, batch| Ok(writer.write_batch(&batch)?))?;
            with(writer, |writer| Ok(writer.finish().map(|_| ())?))
        }
    }
}

/// The first and last rows, `most` together; all rows without a limit.
pub fn excerpt(frame: LazyFrame, most: Option<usize>) -> Result<Excerpt, PolarsError> {
    let mut frame = frame;
    let schema = frame.collect_schema()?;
    let (head, tail) = most.map_or((usize::MAX, 0), |most| (most.div_ceil(2), most / 2));
    let columns = schema.iter().map(|(name, ty)| (name.to_string(), ty.to_string())).collect();
    let empty = Excerpt { columns, ..Excerpt::default() };
    let filled = each(frame, empty, move |excerpt, batch| excerpt.add(&batch, head, tail))?;
    with(filled, Ok)
}

impl Excerpt {
    fn add(&mut self, batch: &DataFrame, head: usize, tail: usize) -> Result<(), PolarsError> {
        let height = batch.height();
        let skipped = height.saturating_sub(tail);
        for row in 0..height {
            if self.head.len() < head {
                self.head.push(cells(batch, row)?);
            } else if tail > 0 && row >= skipped {
                if self.tail.len() == tail {
                    self.tail.pop_front();
                }
                self.tail.push_back(cells(batch, row)?);
            }
        }
        self.rows += height;
        Ok(())
    }
}

fn cells(batch: &DataFrame, row: usize) -> Result<Vec<Option<String>>, PolarsError> {
    let cell = |value: AnyValue| match value {
        AnyValue::Null => None,
        AnyValue::String(text) => Some(text.to_owned()),
        AnyValue::StringOwned(text) => Some(text.to_string()),
        AnyValue::Float32(value) => Some(value.to_string()),
        AnyValue::Float64(value) => Some(value.to_string()),
        other => Some(other.to_string()),
    };
    batch.columns().iter().map(|column| Ok(cell(column.get(row)?))).collect()
}

/// Runs a frame and passes each batch to `work`, in order; returns `into`.
fn each<T: Send + 'static>(
    frame: LazyFrame,
    into: T,
    work: impl Fn(&mut T, DataFrame) -> Result<(), PolarsError> + Send + Sync + 'static,
) -> Result<T, PolarsError> {
    let shared = Arc::new(Mutex::new((Some(into), None)));
    let (inner, work) = (Arc::clone(&shared), Arc::new(work));
    let receive = move |batch: DataFrame| {
        let mut state = inner.lock().unwrap_or_else(PoisonError::into_inner);
        let (into, failed) = &mut *state;
        if let Some(into) = into.as_mut().filter(|_| failed.is_none()) {
            *failed = work(into, batch).err();
        }
        Ok(failed.is_some())
    };
    match run_into(frame.clone(), receive.clone()) {
        // Polars sums `SELECT COUNT(*)` over several files in a type that this build lacks. It fails before the first
        // batch; reading every column avoids the sum.
        Err(PolarsError::Failed(words)) if words.contains("UInt128") => {
            run_into(frame.with_projection_pushdown(false), receive)?;
        }
        other => other?,
    }
    let mut state = shared.lock().unwrap_or_else(PoisonError::into_inner);
    match (state.0.take(), state.1.take()) {
        (_, Some(error)) => Err(error),
        (Some(into), None) => Ok(into),
        (None, None) => Err(PolarsError::Failed("its answer is gone".to_owned())),
    }
}

/// Runs a frame and passes its batches in order to `receive`, which returns true to stop.
fn run_into(
    frame: LazyFrame,
    receive: impl Fn(DataFrame) -> PolarsResult<bool> + Send + Sync + 'static,
) -> Result<(), PolarsError> {
    let sink = frame.sink_batches(PlanCallback::new(receive), true, Some(BATCH))?;
    let run = || sink.collect_with_engine(Engine::Streaming);
    contained_on_all_threads(run).map_err(PolarsError::panicked)??;
    Ok(())
}

fn with<T, R>(into: T, finish: impl FnOnce(T) -> Result<R, PolarsError>) -> Result<R, PolarsError> {
    contained_on_all_threads(|| finish(into)).map_err(PolarsError::panicked)?
}
