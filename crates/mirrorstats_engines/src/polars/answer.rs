//! A query's rows, written batch by batch: as CSV, JSON lines, Parquet, or the head and tail of a table.
//!
//! Rule: rows come in the order of the query; null and empty stay distinct.

use std::collections::{BTreeMap, HashSet, VecDeque};
use std::io::Write;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, PoisonError};

use polars::prelude::{
    AnyValue, CsvWriter, DataFrame, Engine, IntoLazy as _, JsonFormat, JsonWriter, LazyFrame, ParquetWriter,
    PlanCallback, PolarsResult, SerWriter as _, col, df,
};

use super::accepted::Kind;
use super::plan::Planner;
use super::refused::QueryError;
use super::relation::{self, Names, Relation};
use super::run::PolarsError;
use super::statement::{Asked, Checked, Table};
use super::value::Value;
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
            let value = Value { expr: col(name.as_str()), kind, bits };
            relation::Column { table: table.name().to_owned(), name: name.to_string(), value, hidden: false }
        });
        let columns = columns.collect();
        relations.insert(table, Relation { frame, columns });
    }
    match &query.asked {
        Asked::Tables => Ok(df!("name" => Table::ALL.map(Table::name)).map_err(PolarsError::from)?.lazy()),
        Asked::Columns(table) => {
            let columns = relations.get(table).into_iter().flat_map(|relation| &relation.columns);
            let (names, types): (Vec<_>, Vec<_>) =
                columns.map(|column| (column.name.as_str(), sql_type(&column.value))).unzip();
            Ok(df!("column_name" => names, "column_type" => types).map_err(PolarsError::from)?.lazy())
        }
        Asked::Rows(rows) => {
            let planned = with_stack(&query.source.text, || {
                let names = Names::default();
                contained_on_all_threads(|| named(Planner::new(&query.source, &relations, &names).query(rows)?))
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
        chosen.push(column.value.expr.clone().alias(name.as_str()));
        taken.insert(name);
    }
    let mut frame = relation.frame.select(chosen);
    // Types are resolved here, before a row is read.
    frame.collect_schema().map_err(PolarsError::from)?;
    Ok(frame)
}

fn sql_type(value: &Value) -> &'static str {
    match (value.kind, value.bits) {
        (Kind::Int, 7) => "TINYINT",
        (Kind::Int, 31) => "INTEGER",
        (kind, _) => kind.sql(),
    }
}

pub fn write<W: Write + Send + 'static>(mut frame: LazyFrame, format: Format, out: W) -> Result<(), PolarsError> {
    let schema = frame.collect_schema()?;
    match format {
        Format::Csv => {
            let writer = CsvWriter::new(out).batched(&schema)?;
            each(frame, writer, |writer, batch| writer.write_batch(&batch), |mut writer| writer.finish())
        }
        Format::JsonLines => {
            let write = |out: &mut W, mut batch: DataFrame| {
                JsonWriter::new(out).with_json_format(JsonFormat::JsonLines).finish(&mut batch)
            };
            each(frame, out, write, |mut out| Ok(out.flush()?))
        }
        Format::Parquet => {
            let writer = ParquetWriter::new(out).batched(&schema)?;
            each(frame, writer, |writer, batch| writer.write_batch(&batch), |writer| writer.finish().map(drop))
        }
    }
}

/// The first and last rows, `most` together; all rows without a limit.
pub fn excerpt(mut frame: LazyFrame, most: Option<usize>) -> Result<Excerpt, PolarsError> {
    let schema = frame.collect_schema()?;
    let (head, tail) = most.map_or((usize::MAX, 0), |most| (most.div_ceil(2), most / 2));
    let columns = schema.iter().map(|(name, ty)| (name.to_string(), ty.to_string())).collect();
    let empty = Excerpt { columns, ..Excerpt::default() };
    each(frame, empty, move |excerpt, batch| excerpt.add(&batch, head, tail), Ok)
}

impl Excerpt {
    fn add(&mut self, batch: &DataFrame, head: usize, tail: usize) -> PolarsResult<()> {
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

fn cells(batch: &DataFrame, row: usize) -> PolarsResult<Vec<Option<String>>> {
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

/// Runs a frame, passes each batch to `work`, in order, and then finishes.
fn each<T: Send + 'static, R>(
    frame: LazyFrame,
    into: T,
    work: impl Fn(&mut T, DataFrame) -> PolarsResult<()> + Send + Sync + 'static,
    finish: impl FnOnce(T) -> PolarsResult<R>,
) -> Result<R, PolarsError> {
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
        (_, Some(error)) => Err(error.into()),
        (Some(into), None) => {
            contained_on_all_threads(|| finish(into)).map_err(PolarsError::panicked)?.map_err(PolarsError::from)
        }
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
