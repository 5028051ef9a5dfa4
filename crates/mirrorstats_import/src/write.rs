//! The second pass: casts the rows of every episode and writes them in their order.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::{panic, thread};

use arrow::array::{Int32Array, RecordBatch, UInt32Array, new_null_array};
use arrow::compute::{concat_batches, take_record_batch};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use arrow::error::ArrowError;
use parquet::errors::ParquetError;
use serde_json::json;

use super::Limits;
use super::arrays::stored;
use super::columns::Columns;
use super::error::ImportError;
use super::index::IndexedSteps;
use super::mapping::Order;
use super::text::Text;
use mirrorstats_exact::replace::NewFile;
use mirrorstats_identification::put_version;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::schema::Kind;
use mirrorstats_trace::write::row_groups::{Filling, RowGroups, field};

/// Writes the rows to a temporary file beside `out`.
pub(super) fn write(
    texts: &[Text],
    columns: &mut Columns,
    steps: &[IndexedSteps],
    out: &Path,
    limits: Limits<'_>,
) -> Result<NewFile, ImportError> {
    let mut recording = limits.recording(texts);
    if !columns.absent.is_empty() {
        let declared = |(name, absent): (&String, &BTreeSet<String>)| json!({ "name": name, "absent": absent });
        recording["experiments"] = columns.absent.iter().map(declared).collect();
    }
    if columns.is_derived {
        put_version(&mut recording);
    }
    let file = NewFile::create(out).map_err(|error| TraceError::write(out, error))?;
    let failed = |error: ParquetError| TraceError::write(out, error);
    let (fields, kinds): (Vec<_>, Vec<_>) = fields(columns, limits).unzip();
    let layout = Arc::new(Schema::new(fields));
    let file = RowGroups::new(file, &layout, Some(&recording)).map_err(failed)?;
    let mut gathering = Gathering { texts, columns, limits, layout, kinds, last: None };
    // Reading rows and compressing them take about as long.
    let (sender, receiver) = mpsc::sync_channel(1);
    let (gathered, written) = thread::scope(|scope| {
        let writer = scope.spawn(move || written(file, receiver));
        let gathered = gathering.send(steps, &sender);
        drop(sender);
        (gathered, writer.join().unwrap_or_else(|panic| panic::resume_unwind(panic)))
    });
    gathered?;
    Ok(written.map_err(failed)?)
}

fn written(mut file: RowGroups<NewFile>, batches: Receiver<RecordBatch>) -> Result<NewFile, ParquetError> {
    for rows in batches {
        file.write(&rows)?;
    }
    file.finish(None)
}

/// The columns of the trace. A declared type holds whole numbers of a float column, and columns of nulls. A column of
/// nulls without it is compatible with any type in other files.
fn fields(columns: &Columns, limits: Limits<'_>) -> impl Iterator<Item = (Field, Option<Kind>)> {
    let known = columns.known().map(|column| (field(column), Some(column.stored.kind())));
    let own = columns.own().into_iter().map(move |own| {
        let kind = limits.declared(&own.name).map(|declared| declared.kind).or(own.kind);
        (Field::new(&own.name, kind.map_or(DataType::Null, Kind::data_type), true), kind)
    });
    known.chain(own)
}

pub(super) fn count(steps: &[IndexedSteps]) -> usize {
    steps.iter().map(|steps| steps.rows as usize).sum()
}

struct Gathering<'a> {
    texts: &'a [Text],
    columns: &'a mut Columns,
    limits: Limits<'a>,
    layout: SchemaRef,
    kinds: Vec<Option<Kind>>,
    last: Option<((u32, u32), RecordBatch)>,
}

impl Gathering<'_> {
    /// Gives the rows of whole episodes to the writer, which may have failed.
    fn send(&mut self, steps: &[IndexedSteps], writer: &SyncSender<RecordBatch>) -> Result<(), ImportError> {
        let (mut start, mut end, mut rows) = (0, 0, 0);
        let mut row_group = Filling::default();
        for episode in steps.chunk_by(|a, b| a.episode == b.episode) {
            end += episode.len();
            rows += count(episode);
            if row_group.is_due(rows) || end == steps.len() {
                if writer.send(self.rows(&steps[start..end])?).is_err() {
                    return Ok(());
                }
                row_group.add(rows);
                (start, rows) = (end, 0);
            }
        }
        Ok(())
    }

    /// The rows of these steps in their order. Each batch is read once, however scattered its rows are.
    fn rows(&mut self, steps: &[IndexedSteps]) -> Result<RecordBatch, ImportError> {
        let mut by_batch: BTreeMap<(u32, u32), Vec<(usize, IndexedSteps)>> = BTreeMap::new();
        let mut at = 0;
        for steps in steps {
            by_batch.entry((steps.text, steps.batch)).or_default().push((at, *steps));
            at += steps.rows as usize;
        }
        let (mut parts, mut places) = (Vec::new(), vec![0; at]);
        let mut gathered = 0;
        for (batch, runs) in by_batch {
            for (at, run) in &runs {
                for place in &mut places[*at..][..run.rows as usize] {
                    *place = gathered;
                    gathered += 1;
                }
            }
            let failed = self.texts[batch.0 as usize].failed();
            let rows = self.batch(batch)?;
            let is_slice = runs.windows(2).all(|pair| pair[0].1.row + pair[0].1.rows == pair[1].1.row);
            parts.push(if is_slice {
                let length = runs.iter().map(|(_, run)| run.rows as usize).sum();
                rows.slice(runs[0].1.row as usize, length)
            } else {
                let rows_of_runs = runs.iter().flat_map(|(_, run)| run.row..run.row + run.rows);
                take_record_batch(rows, &UInt32Array::from_iter_values(rows_of_runs)).map_err(failed)?
            });
        }
        let failed = self.texts[steps[0].text as usize].failed();
        self.joined(&parts, places, steps).map_err(failed)
    }

    fn joined(
        &self,
        parts: &[RecordBatch],
        places: Vec<u32>,
        steps: &[IndexedSteps],
    ) -> Result<RecordBatch, ArrowError> {
        let mut rows = concat_batches(&self.layout, parts)?;
        if !places.is_sorted() {
            rows = take_record_batch(&rows, &UInt32Array::from(places))?;
        }
        let is_ordered = |text: &Text| text.read.as_ref().is_some_and(|read| read.order != Order::Numbers);
        let t = self.layout.index_of("t")?;
        if self.texts.iter().any(is_ordered) {
            let mut columns = rows.columns().to_vec();
            let numbers = steps.chunk_by(|a, b| a.episode == b.episode).flat_map(|episode| (1..).take(count(episode)));
            columns[t] = Arc::new(numbers.collect::<Int32Array>());
            rows = RecordBatch::try_new(Arc::clone(&self.layout), columns)?;
        }
        Ok(rows)
    }

    fn batch(&mut self, place: (u32, u32)) -> Result<&RecordBatch, ImportError> {
        if self.last.as_ref().is_none_or(|(last, _)| *last != place) {
            let text = &self.texts[place.0 as usize];
            let rows = text.batch(place.1 as usize)?;
            let (rows, _) = self.columns.completed(&rows, &text.folders, self.limits);
            self.last = Some((place, self.cast(&rows).map_err(text.failed())?));
        }
        let (_, rows) = self.last.as_ref().expect("it was just read");
        Ok(rows)
    }

    fn cast(&self, rows: &RecordBatch) -> Result<RecordBatch, ArrowError> {
        let columns = self.layout.fields().iter().zip(&self.kinds).map(|(field, kind)| {
            let values = rows.column_by_name(field.name()).zip(*kind);
            let nulls = || Ok(new_null_array(field.data_type(), rows.num_rows()));
            values.map_or_else(nulls, |(values, kind)| stored(values, kind, field.data_type()))
        });
        RecordBatch::try_new(Arc::clone(&self.layout), columns.collect::<Result<_, _>>()?)
    }
}
