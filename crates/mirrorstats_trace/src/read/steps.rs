//! The steps of traces as Arrow batches for other programs: every file gives the same columns and types, with nulls for
//! columns that it does not have.

use std::collections::{BTreeSet, VecDeque};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::vec;

use arrow::array::{Array as _, ArrayRef, AsArray as _, BooleanArray, RecordBatch, RecordBatchOptions, new_null_array};
use arrow::compute::{CastOptions, cast, cast_with_options, filter_record_batch};
use arrow::datatypes::{DataType, Field, Fields, Schema, SchemaRef};
use parquet::arrow::ProjectionMask;

use super::flat::CheckedRows;
use super::footer::folder_columns::FolderColumn;
use super::footer::trace_file::{Readable, TraceFile};
use super::open::TraceSet;
use super::projection::Layout;
use crate::diagnostic::{Code, Finding};
use crate::error::TraceError;
use crate::schema::{Kind, Stored};
use mirrorstats_exact::input;
use mirrorstats_parquet_pages::{Expansion, FaultSlot, Library, Store};

const BATCH_ROWS: usize = 8 * 1024;
/// With views, a batch holds no text, so that it can have more rows.
const BATCH_ROWS_OF_VIEWS: usize = 64 * 1024;
const EPISODE_ID: &str = "episode_id";

/// The most batches that a thread decodes ahead of the reader.
const AHEAD: usize = 4;

/// The rows of all files in order, in batches. Checksums are checked, but not the rules of traces.
///
/// An error ends the iteration. One thread per row group decodes ahead.
pub struct Steps {
    shape: StepSelection,
    parts: vec::IntoIter<Part>,
    /// Row groups that are being decoded: the name of the file, and the rows.
    ahead: VecDeque<(String, Receiver<Rows>)>,
    threads: NonZeroUsize,
}

#[derive(Clone)]
struct StepSelection {
    schema: SchemaRef,
    episodes: Option<Arc<BTreeSet<String>>>,
}

struct Part {
    name: String,
    path: PathBuf,
    readable: Arc<Readable>,
    expansion: Arc<Expansion>,
    folders: Vec<FolderColumn>,
    row_group: usize,
}

/// Rows, or `None` at the end of a row group.
type Rows = Result<Option<RecordBatch>, TraceError>;

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
        let layout = Layout::new(set, [], names.iter().map(String::as_str))?;
        let field = |name: &String| {
            let kind = layout.position(name).map_or(Kind::String, |at| layout.columns[at].kind);
            Field::new(name, data_type(set, name, kind), true)
        };
        let schema = Arc::new(Schema::new(names.iter().map(field).collect::<Vec<_>>()));
        let files = set.files().iter().map(|file| Part::of_file(file).map_err(TraceError::from));
        let parts: Vec<Vec<Part>> = files.collect::<Result<_, _>>()?;
        let parts = parts.into_iter().flatten().collect::<Vec<_>>().into_iter();
        let shape = StepSelection { schema, episodes: episodes.map(Arc::new) };
        Ok(Self { shape, parts, ahead: VecDeque::new(), threads })
    }

    /// The same steps with texts as `Utf8View`: equal texts of a page share their bytes.
    #[must_use]
    pub fn with_views(mut self) -> Self {
        self.shape.schema = Arc::new(Schema::new(with_views(self.shape.schema.fields())));
        self
    }

    /// The columns: those of the schema with its types, others as text, int64, float64 or bool; all may be null.
    pub fn schema(&self) -> SchemaRef {
        Arc::clone(&self.shape.schema)
    }

    fn rows(&mut self) -> Rows {
        loop {
            let free = self.threads.get().saturating_sub(self.ahead.len());
            self.ahead.extend(self.parts.by_ref().take(free).map(|part| part.ahead(self.shape.clone())));
            let Some((name, rows)) = self.ahead.front() else { return Ok(None) };
            let expected = "a row group that can be read";
            let gone = || Box::new(Finding::new(Code::Unreadable, name, expected, "a thread that ended early"));
            match rows.recv().map_err(|_| TraceError::from(gone()))?? {
                None => drop(self.ahead.pop_front()),
                some => return Ok(some),
            }
        }
    }
}

impl StepSelection {
    fn complete(&self, rows: &RecordBatch, folders: &[FolderColumn]) -> Result<RecordBatch, TraceError> {
        let column = |field: &Arc<Field>| -> Result<ArrayRef, arrow::error::ArrowError> {
            let options = CastOptions { safe: false, ..CastOptions::default() };
            match rows.column_by_name(field.name()) {
                Some(values) => cast_with_options(values, field.data_type(), &options),
                None => match folders.iter().find(|folder| folder.column.name == *field.name()) {
                    Some(folder) => folder.repeated(field.data_type(), rows.num_rows()),
                    None => Ok(new_null_array(field.data_type(), rows.num_rows())),
                },
            }
        };
        let columns = self.schema.fields().iter().map(column).collect::<Result<Vec<_>, _>>();
        // Without columns, only this gives the number of rows.
        let options = RecordBatchOptions::new().with_row_count(Some(rows.num_rows()));
        let batch =
            columns.and_then(|columns| RecordBatch::try_new_with_options(Arc::clone(&self.schema), columns, &options));
        let batch = batch.map_err(TraceError::Memory)?;
        let (Some(episodes), Some(ids)) = (&self.episodes, rows.column_by_name(EPISODE_ID)) else { return Ok(batch) };
        let ids = cast(ids, &DataType::Utf8).map_err(TraceError::Memory)?;
        let ids = ids.as_string::<i32>();
        let wanted: BooleanArray =
            (0..ids.len()).map(|row| Some(ids.is_valid(row) && episodes.contains(ids.value(row)))).collect();
        filter_record_batch(&batch, &wanted).map_err(TraceError::Memory)
    }
}

impl Iterator for Steps {
    type Item = Result<RecordBatch, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        let rows = self.rows();
        if rows.is_err() {
            self.ahead.clear();
            self.parts = Vec::new().into_iter();
        }
        rows.transpose()
    }
}

/// The type of a column: the schema's, or the widest of its kind for columns outside the schema.
fn data_type(set: &TraceSet, name: &str, kind: Kind) -> DataType {
    let known = set.domain().column(name).filter(|column| column.stored.kind() == kind).map(|column| column.stored);
    known.map_or(kind.data_type(), Stored::data_type)
}

fn with_views(fields: &Fields) -> Fields {
    let viewed = |field: &Arc<Field>| {
        let held = if let DataType::Dictionary(_, values) = field.data_type() { values } else { field.data_type() };
        match held {
            DataType::Utf8 | DataType::LargeUtf8 => Arc::new(field.as_ref().clone().with_data_type(DataType::Utf8View)),
            _ => Arc::clone(field),
        }
    };
    fields.iter().map(viewed).collect()
}

impl Part {
    fn of_file(file: &TraceFile) -> Result<Vec<Self>, Box<Finding>> {
        let readable = file.footer()?;
        let part = |row_group| Self {
            name: file.name().to_owned(),
            path: file.path().to_owned(),
            readable: Arc::clone(&readable),
            expansion: Arc::clone(&file.expansion),
            folders: file.folders().to_vec(),
            row_group,
        };
        Ok((0..readable.footer.metadata().num_row_groups()).map(part).collect())
    }

    fn ahead(self, shape: StepSelection) -> (String, Receiver<Rows>) {
        let (sender, rows) = sync_channel(AHEAD);
        let name = self.name.clone();
        thread::spawn(move || {
            let end = self.send(&shape, &sender).map(|()| None);
            // If this fails, the reader is gone.
            let _ = sender.send(end);
        });
        (name, rows)
    }

    fn send(self, shape: &StepSelection, sender: &SyncSender<Rows>) -> Result<(), TraceError> {
        let folders = self.folders.clone();
        for rows in self.reader(&shape.schema)? {
            if sender.send(Ok(Some(shape.complete(&rows?, &folders)?))).is_err() {
                break;
            }
        }
        Ok(())
    }

    fn reader(self, schema: &Schema) -> Result<CheckedRows, Box<Finding>> {
        let Self { name, path, readable, expansion, row_group, .. } = self;
        let file = input::open(&path).map_err(|error| Finding::unreadable(&name, &error))?;
        let store = Store::new(file, expansion);
        let metadata = Arc::clone(readable.footer.metadata());
        let described = metadata.file_metadata().schema_descr();
        let wanted = described.columns().iter().enumerate().filter(|(_, column)| {
            let path = column.path().parts();
            path.len() == 1 && (path[0] == EPISODE_ID || schema.field_with_name(&path[0]).is_ok())
        });
        let has_views = schema.fields().iter().any(|field| *field.data_type() == DataType::Utf8View);
        let fields = has_views.then(|| with_views(readable.footer.schema().fields()));
        let batch = if has_views { BATCH_ROWS_OF_VIEWS } else { BATCH_ROWS };
        let columns = ProjectionMask::leaves(described, wanted.map(|(at, _)| at).collect::<Vec<_>>());
        let library = Library {
            store,
            metadata: Arc::clone(&metadata),
            checksums: readable.chunks.clone(),
            row_groups: vec![row_group],
            slot: FaultSlot::default(),
            writes_out: !has_views,
        };
        CheckedRows::open(&name, &library, columns, fields.as_ref(), batch, None)
    }
}
