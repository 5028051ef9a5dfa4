//! Writes traces: whole episodes into row groups, and a file that appears whole or not at all.
//!
//! Rule: what this writer makes passes `validate` without a note, and the same episodes give the same bytes.
//! The optional columns of a file are declared when it is created, so that memory stays flat; a value for a
//! column that was not declared is refused, never dropped.

use std::collections::HashSet;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::datatypes::{Schema, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_writer::ArrowWriterOptions;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

use super::episode::Episode;
use super::finding::TraceError;
use super::schema::{self, COLUMNS, Column, REPLY_REPAIR};
use super::source::{Gathered, Source, field};
use crate::base::replace::NewFile;

/// What a trace file is created with, besides its episodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TraceMetadata {
    /// How the recording was made, a JSON object (scene and prompt hashes, view size, ...); left out if `None`.
    pub recording: Option<serde_json::Value>,
    /// The optional columns that the file has.
    pub columns: OptionalColumns,
}

/// Columns that a trace may have besides the required ones: the schema's in its order, then the recorder's own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OptionalColumns(Vec<&'static Column>);

impl OptionalColumns {
    /// No optional column.
    pub const NONE: Self = Self(Vec::new());

    /// All of the schema.
    pub fn all() -> Self {
        Self(COLUMNS.iter().filter(|column| !column.required).collect())
    }

    /// Those of a recording: all of the schema, and where its agent's replies are read, what had to be repaired.
    pub fn recorded(recording: &serde_json::Value) -> Self {
        let mut columns = Self::all();
        let agent = &recording["agent"];
        if agent.is_object() && agent.get("scripted").is_none() {
            columns.0.push(&REPLY_REPAIR);
        }
        columns
    }

    /// Those of these names; `None` if one is no optional column of the schema.
    pub fn named(names: &[&str]) -> Option<Self> {
        let columns = Self::all().0.into_iter().filter(|column| names.contains(&column.name)).collect::<Vec<_>>();
        names.iter().all(|name| columns.iter().any(|column| column.name == *name)).then_some(Self(columns))
    }

    /// Those that have a value in one of these episodes.
    pub fn used_by<'a>(episodes: impl IntoIterator<Item = &'a Episode>) -> Self {
        let mut used = Vec::new();
        let mut unused: Vec<_> = known().filter(|column| !column.required).collect();
        for episode in episodes {
            let (found, rest) = unused.into_iter().partition::<Vec<_>, _>(|column| has_value(column, episode));
            used.extend(found);
            unused = rest;
        }
        Self(known().filter(|column| used.contains(column)).collect())
    }
}

/// All columns that this writer can write, in their order.
fn known() -> impl Iterator<Item = &'static Column> {
    COLUMNS.iter().chain([&REPLY_REPAIR])
}

fn has_value(column: &Column, episode: &Episode) -> bool {
    Source::of(column.name).is_some_and(|source| source.has_value(episode))
}

/// Rows after which a row group is closed, at the next end of an episode.
pub(super) const ROW_GROUP_ROWS: usize = 128 * 1024;
/// Rows that are gathered before they are encoded.
pub(super) const GATHERED_ROWS: usize = 8 * 1024;

/// Encodes episodes as a trace into anything that bytes can be written to.
pub struct TraceEncoder<W: Write + Send> {
    parquet: ArrowWriter<W>,
    layout: SchemaRef,
    columns: Vec<Gathered>,
    undeclared: Vec<&'static Column>,
    seen: HashSet<String>,
    gathered_rows: usize,
    row_group_rows: usize,
}

impl<W: Write + Send> TraceEncoder<W> {
    /// Starts a trace.
    ///
    /// # Errors
    /// Whatever writing gives.
    pub fn new(out: W, metadata: &TraceMetadata) -> Result<Self, TraceError> {
        let (layout, undeclared): (Vec<&Column>, Vec<&Column>) =
            known().partition(|column| column.required || metadata.columns.0.contains(column));
        let columns = layout.iter().filter_map(|column| Source::of(column.name)).map(Gathered::new).collect();
        let layout = Arc::new(Schema::new(layout.into_iter().map(field).collect::<Vec<_>>()));
        // Parquet's own logical types say all of it; an embedded Arrow schema would only pin one library's view.
        let options = ArrowWriterOptions::new()
            .with_properties(properties(metadata.recording.as_ref()))
            .with_skip_arrow_metadata(true);
        let parquet = ArrowWriter::try_new_with_options(out, Arc::clone(&layout), options).map_err(failed)?;
        Ok(Self { parquet, layout, columns, undeclared, seen: HashSet::new(), gathered_rows: 0, row_group_rows: 0 })
    }

    /// Adds an episode; t is 1, 2, ... in the order of its steps.
    ///
    /// # Errors
    /// [`TraceError::Refused`] for what the schema forbids: no step, an id that was there before, an empty name, a
    /// negative count, a value in an optional column that was not declared. Otherwise whatever writing gives.
    pub fn write(&mut self, episode: &Episode) -> Result<(), TraceError> {
        check(episode, &self.undeclared)?;
        if !self.seen.insert(episode.episode_id.clone()) {
            return refused(episode, "an id of its own".into(), "the id of an episode before it".into());
        }
        for column in &mut self.columns {
            column.extend(episode);
        }
        self.gathered_rows += episode.steps.len();
        self.row_group_rows += episode.steps.len();
        if self.row_group_rows >= ROW_GROUP_ROWS {
            self.encode()?;
            self.parquet.flush().map_err(failed)?;
            self.row_group_rows = 0;
        } else if self.gathered_rows >= GATHERED_ROWS {
            self.encode()?;
        }
        Ok(())
    }

    /// Writes what is left and the footer.
    ///
    /// # Errors
    /// Whatever writing gives.
    pub fn finish(mut self) -> Result<W, TraceError> {
        self.encode()?;
        self.parquet.into_inner().map_err(failed)
    }

    fn encode(&mut self) -> Result<(), TraceError> {
        if self.gathered_rows > 0 {
            let columns = self.columns.iter_mut().map(Gathered::take).collect();
            let batch = RecordBatch::try_new(Arc::clone(&self.layout), columns).map_err(|e| failed(e.into()))?;
            self.parquet.write(&batch).map_err(failed)?;
            self.gathered_rows = 0;
        }
        Ok(())
    }
}

pub(super) fn properties(recording: Option<&serde_json::Value>) -> WriterProperties {
    let pair = |key: &str, value: String| KeyValue::new(key.to_owned(), value);
    let mut pairs = vec![
        pair(schema::VERSION_KEY, schema::SCHEMA_VERSION.to_string()),
        pair(schema::WRITER_KEY, concat!("mirrorstats ", env!("CARGO_PKG_VERSION")).to_owned()),
    ];
    pairs.extend(recording.map(|json| pair(schema::RECORDING_KEY, json.to_string())));
    WriterProperties::builder()
        .set_key_value_metadata(Some(pairs))
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        // Row groups end where an episode does, never at a number of rows.
        .set_max_row_group_row_count(None)
        .build()
}

fn check(episode: &Episode, undeclared: &[&'static Column]) -> Result<(), TraceError> {
    let steps = episode.steps.len();
    if steps == 0 || i32::try_from(steps).is_err() {
        return refused(episode, format!("1 to {} steps", i32::MAX), steps.to_string());
    }
    for column in known() {
        if let Some((expected, found)) = Source::of(column.name).and_then(|source| source.fault(column, episode)) {
            return refused(episode, expected, found);
        }
    }
    match undeclared.iter().find(|column| has_value(column, episode)) {
        None => Ok(()),
        Some(column) => {
            let expected = format!("no value for `{}`, which was not declared when the file was created", column.name);
            refused(episode, expected, "one".into())
        }
    }
}

fn refused(episode: &Episode, expected: String, found: String) -> Result<(), TraceError> {
    Err(TraceError::Refused { episode: episode.episode_id.clone(), expected, found })
}

fn failed(error: ParquetError) -> TraceError {
    TraceError::Write { file: "stream".into(), source: Box::new(error) }
}

/// Writes a trace file, which appears under its name when [`finish`](Self::finish) returns.
pub struct TraceWriter {
    encoder: TraceEncoder<NewFile>,
    path: PathBuf,
}

impl TraceWriter {
    /// Starts the trace that will be at `path`, replacing what is there; its folder must exist.
    ///
    /// # Errors
    /// When no file can be made in that folder.
    pub fn create(path: &Path, metadata: &TraceMetadata) -> Result<Self, TraceError> {
        let file = NewFile::create(path).map_err(|source| unwritable(path, source))?;
        let encoder = TraceEncoder::new(file, metadata).map_err(|error| named(error, path))?;
        Ok(Self { encoder, path: path.to_owned() })
    }

    /// Adds an episode; t is 1, 2, ... in the order of its steps.
    ///
    /// # Errors
    /// As [`TraceEncoder::write`].
    pub fn write(&mut self, episode: &Episode) -> Result<(), TraceError> {
        self.encoder.write(episode).map_err(|error| named(error, &self.path))
    }

    /// Completes the file, synchronises it with the disk and gives it its name.
    ///
    /// # Errors
    /// Whatever writing gives; the file at the path is as it was then.
    pub fn finish(self) -> Result<(), TraceError> {
        let Self { encoder, path } = self;
        let file = encoder.finish().map_err(|error| named(error, &path))?;
        file.commit().map_err(|source| unwritable(&path, source))
    }
}

/// Writes these episodes as one trace file with the optional columns that they use.
///
/// # Errors
/// As [`TraceWriter`].
pub fn write_episodes(
    path: &Path,
    recording: Option<serde_json::Value>,
    episodes: &[Episode],
) -> Result<(), TraceError> {
    let metadata = TraceMetadata { recording, columns: OptionalColumns::used_by(episodes) };
    let mut writer = TraceWriter::create(path, &metadata)?;
    for episode in episodes {
        writer.write(episode)?;
    }
    writer.finish()
}

pub(super) fn unwritable(path: &Path, source: io::Error) -> TraceError {
    TraceError::Write { file: path.display().to_string(), source: Box::new(source) }
}

fn named(error: TraceError, path: &Path) -> TraceError {
    match error {
        TraceError::Write { source, .. } => TraceError::Write { file: path.display().to_string(), source },
        other => other,
    }
}
