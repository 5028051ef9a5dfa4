//! A query's rows, written batch by batch: as CSV, JSON lines, Parquet, or the head and tail of a table.
//!
//! Rule: rows come in the order of the query; null and empty stay distinct.

use std::collections::{BTreeMap, HashSet, VecDeque};
use std::io::Write;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use polars::prelude::{
    AnyValue, Column, CsvWriter, DataFrame, Engine, IntoLazy as _, JsonFormat, JsonWriter, LazyFrame, ParquetWriter,
    PlanCallback, PolarsError as Inner, PolarsResult, SerWriter as _, col,
};

use super::accepted::Kind;
use super::plan::Planner;
use super::refused::QueryError;
use super::relation::{self, Relation};
use super::run::PolarsError;
use super::statement::{Asked, Checked, Table};
use mirrorstats_metric::syntax::grammar::with_stack;
use mirrorstats_trace::catch_panic::contained_on_all_threads;

const BATCH: NonZeroUsize = NonZeroUsize::new(1 << 17).expect("not zero");

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

/// The lazy answer to a query over its tables.
pub fn plan(query: &Checked, tables: Vec<(Table, LazyFrame)>) -> Result<LazyFrame, QueryError> {
    let mut relations = BTreeMap::new();
    for (table, mut frame) in tables {
        let schema = frame.collect_schema().map_err(PolarsError::from)?;
        let columns = schema.iter().map(|(name, ty)| {
            let (kind, bits) = Kind::of(ty);
            let (name, inner) = (name.to_string(), name.to_string());
            relation::Column { table: table.name().to_owned(), name, inner, kind, bits, hidden: false }
        });
        let columns = columns.collect();
        relations.insert(table, Relation { frame, columns });
    }
    match &query.asked {
        Asked::Tables => Ok(listed("name", Table::ALL.map(Table::name), None)?),
        Asked::Columns(table) => {
            let columns = relations.get(table).into_iter().flat_map(|relation| &relation.columns);
            let (names, types): (Vec<_>, Vec<_>) =
                columns.map(|column| (column.name.as_str(), sql_type(column.kind, column.bits))).unzip();
            Ok(listed("column_name", names, Some(types))?)
        }
        Asked::Rows(rows) => {
            let planned = with_stack(&query.source.text, || {
                contained_on_all_threads(|| named(Planner::new(&query.source, &relations).query(rows)?))
            });
            planned.map_err(PolarsError::panicked)?
        }
    }
}

/// Gives the columns their names. Of two with one name, the second gets a number, as in DuckDB's files.
fn named(relation: Relation) -> Result<LazyFrame, QueryError> {
    let mut taken = HashSet::new();
    let mut chosen = Vec::new();
    for column in &relation.columns {
        let numbered = (1..).map(|number| format!("{}_{number}", column.name));
        let name = std::iter::once(column.name.clone()).chain(numbered).find(|name| !taken.contains(name));
        let name = name.unwrap_or_default();
        chosen.push(col(column.inner.as_str()).alias(name.as_str()));
        taken.insert(name);
    }
    let mut frame = relation.frame.select(chosen);
    // Types are resolved here, before a row is read.
    frame.collect_schema().map_err(PolarsError::from)?;
    Ok(frame)
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

fn sql_type(kind: Kind, bits: u32) -> &'static str {
    match (kind, bits) {
        (Kind::Int, 7) => "TINYINT",
        (Kind::Int, 31) => "INTEGER",
        _ => kind.sql(),
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
    let receive = move |mut batch: DataFrame| {
        // After grouping sets, the columns of a batch may be divided at different rows, which no writer takes.
        batch.align_chunks_par();
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
