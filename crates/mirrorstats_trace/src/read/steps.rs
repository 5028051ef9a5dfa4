//! The steps of traces as Arrow batches for other programs: every file gives the same columns and types, with nulls for
//! columns that it does not have.

use std::collections::{BTreeSet, VecDeque};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::vec;

use arrow::array::{BooleanArray, RecordBatch, RecordBatchOptions};
use arrow::compute::{CastOptions, cast_with_options, filter_record_batch};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};

use super::decode::{RowGroup, Rows};
use super::entry_use::EntryUse;
use super::footer::trace_file::{Readable, TraceFile};
use super::open::TraceSet;
use super::projection::Layout;
use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use crate::schema::{Kind, Stored};

/// Rows of a batch whose texts are written out.
const BATCH_ROWS: usize = 8 * 1024;

/// The most batches that a thread decodes ahead of the reader.
const AHEAD: usize = 4;

/// The rows of all files in order, in batches. Checksums are checked, but not the rules of traces.
///
/// An error ends the iteration. One thread per row group decodes ahead.
pub struct Steps {
    selection: StepSelection,
    left: vec::IntoIter<(usize, usize)>,
    ahead: VecDeque<(usize, Receiver<Batch>)>,
    /// Held so that a file's footer is read once for all its row groups.
    footer: Option<Arc<Readable>>,
    threads: NonZeroUsize,
}

#[derive(Clone)]
struct StepSelection {
    files: Arc<[TraceFile]>,
    layout: Arc<Layout>,
    schema: SchemaRef,
    episodes: Option<Arc<BTreeSet<String>>>,
}

/// A batch, or `None` at the end of a row group.
type Batch = Result<Option<RecordBatch>, TraceError>;

impl Steps {
    /// The steps of these episodes, with these columns in this order; all episodes or columns if absent.
    pub fn new(
        set: &TraceSet,
        columns: Option<&[String]>,
        episodes: Option<BTreeSet<String>>,
        threads: NonZeroUsize,
    ) -> Result<Self, TraceError> {
        let is_readable = |name: &&str| {
            set.column(name).is_some_and(|column| column.kind != Kind::Unsupported || column.conflict.is_some())
        };
        let all = || set.column_names().into_iter().filter(is_readable).map(str::to_owned).collect();
        let names: Vec<String> = columns.map_or_else(all, <[String]>::to_vec);
        let layout = Layout::new(set, names.iter().map(String::as_str), [])?;
        let field = |name: &String| {
            let kind = layout.position(name).map_or(Kind::String, |at| layout.columns[at].kind);
            Field::new(name, data_type(set, name, kind), true)
        };
        let schema = Arc::new(Schema::new(names.iter().map(field).collect::<Vec<_>>()));
        let files = set.shared_files();
        let row_groups = files.iter().enumerate();
        let row_groups = row_groups.flat_map(|(at, file)| (0..file.row_groups()).map(move |group| (at, group)));
        let left = row_groups.collect::<Vec<_>>().into_iter();
        let selection = StepSelection { files, layout: Arc::new(layout), schema, episodes: episodes.map(Arc::new) };
        Ok(Self { selection, left, ahead: VecDeque::new(), footer: None, threads })
    }

    /// The same steps with texts as `Utf8View`: equal texts of a batch share their bytes.
    #[must_use]
    pub fn with_views(mut self) -> Self {
        let viewed = |field: &Arc<Field>| match field.data_type() {
            DataType::Utf8 => field.as_ref().clone().with_data_type(DataType::Utf8View),
            _ => field.as_ref().clone(),
        };
        let fields: Vec<Field> = self.selection.schema.fields().iter().map(viewed).collect();
        self.selection.schema = Arc::new(Schema::new(fields));
        self
    }

    /// The columns: those of the schema with its types, others as text, int64, float64 or bool; all may be null.
    pub fn schema(&self) -> SchemaRef {
        Arc::clone(&self.selection.schema)
    }

    fn batch(&mut self) -> Batch {
        loop {
            let free = self.threads.get().saturating_sub(self.ahead.len());
            for (file, row_group) in self.left.by_ref().take(free) {
                self.footer = self.selection.files[file].footer().ok();
                self.ahead.push_back((file, self.selection.clone().start(file, row_group)));
            }
            let Some((file, batches)) = self.ahead.front() else { return Ok(None) };
            let name = self.selection.files[*file].name();
            let expected = "a row group that can be read";
            let gone = || Box::new(Finding::new(Code::Unreadable, name, expected, "a thread that ended early"));
            match batches.recv().map_err(|_| TraceError::from(gone()))?? {
                None => drop(self.ahead.pop_front()),
                some => return Ok(some),
            }
        }
    }
}

impl StepSelection {
    fn start(self, file: usize, row_group: usize) -> Receiver<Batch> {
        let (sender, batches) = sync_channel(AHEAD);
        thread::spawn(move || {
            let end = self.send(file, row_group, &sender).map(|()| None);
            // If this fails, the reader is gone.
            let _ = sender.send(end);
        });
        batches
    }

    fn send(&self, file: usize, row_group: usize, sender: &SyncSender<Batch>) -> Result<(), TraceError> {
        for rows in RowGroup::open(&self.files[file], &self.layout, row_group, None)? {
            let rows = rows?;
            self.count_texts(&self.files[file], &rows)?;
            for start in (0..rows.len()).step_by(BATCH_ROWS) {
                let part = rows.slice(start, BATCH_ROWS.min(rows.len() - start));
                if sender.send(Ok(Some(self.batch(&part)?))).is_err() {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Counts the texts that batches write out: in a file, rows may share a long one.
    fn count_texts(&self, file: &TraceFile, rows: &Rows) -> Result<(), Box<Finding>> {
        for field in self.schema.fields().iter().filter(|field| *field.data_type() == DataType::Utf8) {
            let Some(at) = self.layout.position(field.name()) else { continue };
            let Some(texts) = EntryUse::of_column(&rows.columns[at]) else { continue };
            let counted = file.expansion.written((rows.row_group, at), rows.first + rows.len(), texts.bytes());
            counted.map_err(|exceeded| {
                let finding = Finding::over_budget(file.name(), &exceeded).in_row_group(rows.row_group);
                Box::new(finding.in_column(field.name()))
            })?;
        }
        Ok(())
    }

    fn batch(&self, rows: &Rows) -> Result<RecordBatch, TraceError> {
        let casts = CastOptions { safe: false, ..CastOptions::default() };
        let fields = self.schema.fields().iter();
        let found = fields.filter_map(|field| Some((field, &rows.columns[self.layout.position(field.name())?])));
        let columns = found.map(|(field, column)| cast_with_options(&column.flat()?, field.data_type(), &casts));
        // Without columns, only this gives the number of rows.
        let options = RecordBatchOptions::new().with_row_count(Some(rows.len()));
        let batch = columns
            .collect::<Result<_, _>>()
            .and_then(|columns| RecordBatch::try_new_with_options(Arc::clone(&self.schema), columns, &options));
        let batch = batch.map_err(TraceError::Memory)?;
        let Some(episodes) = &self.episodes else { return Ok(batch) };
        let is_wanted = |row| Some(rows.episode(row).is_some_and(|id| episodes.contains(id)));
        let wanted: BooleanArray = (0..rows.len()).map(is_wanted).collect();
        filter_record_batch(&batch, &wanted).map_err(TraceError::Memory)
    }
}

impl Iterator for Steps {
    type Item = Result<RecordBatch, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = self.batch();
        if batch.is_err() {
            self.ahead.clear();
            self.left = Vec::new().into_iter();
        }
        batch.transpose()
    }
}

/// The type of a column: the schema's, or the widest of its kind for columns outside the schema.
fn data_type(set: &TraceSet, name: &str, kind: Kind) -> DataType {
    let known = set.domain().column(name).filter(|column| column.stored.kind() == kind).map(|column| column.stored);
    known.map_or(kind.data_type(), Stored::data_type)
}
