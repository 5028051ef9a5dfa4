//! Merges traces episode by episode, without reading or changing values.
//!
//! Rule: the same episodes in the same order give the same bytes, whatever their files.

use std::borrow::Cow;
use std::fs::File;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, AsArray as _, RecordBatch, StringArray};
use arrow::compute::{cast, concat_batches};
use arrow::datatypes::{DataType, Int64Type, Schema, SchemaRef};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{RowSelection, RowSelector};

use super::decode_episode;
pub use super::decode_episode::{Displayed, NotAnEpisode, OwnColumn};
use crate::catch_panic::contained;
use crate::diagnostic::{Code, Finding};
use crate::episodes::episode::Episode;
use crate::episodes::episode_hash::{self, EPISODE_HASH};
use crate::error::TraceError;
use crate::inputs::Input;
use crate::read::budget::{most_shown, most_values};
use crate::read::flat::CheckedRows;
use crate::read::footer::trace_file::is_nested;
use crate::read::footer::{Extent, Footer, bounds, footer};
use crate::schema::{self, COLUMNS};
use crate::write::row_groups::{Gathered, RowGroups, field};
use crate::write::{self, OptionalColumns};
use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_exact::input;
use mirrorstats_exact::replace::{self, NewFile};
use mirrorstats_parquet_pages::{Expansion, FaultSlot, Library, Store, rows_of};

const BATCH_ROWS: usize = 8 << 10;

/// The rows of one episode, with its id and its order.
#[derive(Clone, Debug)]
pub struct EpisodeRows {
    pub episode_id: String,
    pub seed: i64,
    pub run: i64,
    /// The repetition of its scene, from 1.
    pub repetition: i64,
    rows: RecordBatch,
}

impl EpisodeRows {
    pub fn len(&self) -> usize {
        self.rows.num_rows()
    }

    pub fn episode(&self) -> Result<Episode, NotAnEpisode> {
        decode_episode::episode(&self.rows)
    }

    /// The identity of an episode of any domain; its steps have no values.
    pub fn identity(&self) -> Result<Episode, NotAnEpisode> {
        decode_episode::identity(&self.rows)
    }

    pub fn own_columns(&self) -> Vec<OwnColumn> {
        decode_episode::own_columns(&self.rows)
    }

    /// Replaces some integer or truth columns; columns that do not exist are left out.
    pub fn with_columns(&self, columns: &[(&str, ArrayRef)]) -> Result<Self, TraceError> {
        let schema = self.rows.schema();
        let mut arrays = self.rows.columns().to_vec();
        for (name, values) in columns {
            if let Ok(at) = schema.index_of(name) {
                let values = cast(values, schema.field(at).data_type());
                arrays[at] = values.map_err(|error| unreadable(&self.episode_id, error.into()))?;
            }
        }
        let rows = RecordBatch::try_new(schema, arrays).map_err(|error| unreadable(&self.episode_id, error.into()))?;
        let changed = Self { rows, ..self.clone() };
        if self.rows.column_by_name(EPISODE_HASH).is_some() { changed.hashed() } else { Ok(changed) }
    }

    pub fn stated_hash(&self) -> Option<String> {
        let hashes = cast(self.rows.column_by_name(EPISODE_HASH)?, &DataType::Utf8).ok()?;
        let first = hashes.as_string::<i32>().iter().next().flatten();
        first.map(str::to_owned)
    }

    fn hashed(&self) -> Result<Self, TraceError> {
        let hash = episode_hash::hash_of(&self.episode().map_err(|fault| unreadable(&self.episode_id, fault.into()))?);
        let about = schema::column(EPISODE_HASH).expect("the schema has the column");
        let hash: ArrayRef = Arc::new(StringArray::from(vec![hash; self.len()]));
        let (mut fields, mut arrays) = (self.rows.schema().fields().to_vec(), self.rows.columns().to_vec());
        let rank = |name: &str| COLUMNS.iter().position(|column| column.name == name);
        let place = fields.iter().position(|field| rank(field.name()) >= rank(EPISODE_HASH)).unwrap_or(fields.len());
        if fields.get(place).is_some_and(|field| field.name() == EPISODE_HASH) {
            fields.remove(place);
            arrays.remove(place);
        }
        fields.insert(place, Arc::new(field(about)));
        arrays.insert(place, hash);
        let rows = RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays);
        Ok(Self { rows: rows.map_err(|error| unreadable(&self.episode_id, error.into()))?, ..self.clone() })
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

pub fn read(path: &Path) -> Result<Vec<EpisodeRows>, TraceError> {
    let name = path.display().to_string();
    let (file, footer) = opened(&name, &Input::new(path))?;
    match bounds::fault(&name, footer.bytes, &footer.metadata) {
        // Callers that merge traces accept one without rows.
        Some(fault) if fault.code != Code::NoEpisodes => Err(damaged_file(&name, &fault)),
        _ => {
            let row_groups = (0..footer.metadata.num_row_groups()).collect();
            decode(&name, file, footer, row_groups, None)
        }
    }
}

/// The episodes in some rows of a trace file, counted from its first row. Only the row groups of these rows are read.
/// Values are held row by row, so their number is limited.
pub fn read_rows(of: &Input, rows: Range<usize>) -> Result<Vec<EpisodeRows>, TraceError> {
    let name = &of.name;
    let (file, footer) = opened(name, of)?;
    if let Some(fault) = bounds::fault(name, footer.bytes, &footer.metadata) {
        return Err(damaged_file(name, &fault));
    }
    let over = |exceeded: Exceeded| TraceError::from(Finding::over_budget(name, &exceeded));
    let columns = footer.metadata.file_metadata().schema_descr().num_columns();
    most_values(footer.bytes).check((rows.len() as u64).saturating_mul(columns as u64)).map_err(over)?;
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
    let skipped = skipped.unwrap_or_default();
    let selection = vec![RowSelector::skip(skipped), RowSelector::select(rows.len())];
    let most = most_shown(footer.bytes);
    decode(name, file, footer, groups, Some((selection.into(), most)))
}

fn opened(name: &str, of: &Input) -> Result<(File, Footer), TraceError> {
    let file = input::open(&of.path).map_err(|error| unreadable(name, error.into()))?;
    let footer = footer(of, Extent::Pages).map_err(|finding| damaged_file(name, &finding))?;
    Ok((file, footer))
}

fn damaged_file(name: &str, finding: &Finding) -> TraceError {
    unreadable(name, finding.to_string().into())
}

fn decode(
    name: &str,
    file: File,
    Footer { bytes, metadata, chunks, .. }: Footer,
    row_groups: Vec<usize>,
    selection: Option<(RowSelection, Limit)>,
) -> Result<Vec<EpisodeRows>, TraceError> {
    let failed = |source: Box<dyn std::error::Error + Send + Sync>| unreadable(name, source);
    let columns = metadata.file_metadata().schema_descr().columns();
    if let Some(nested) = columns.iter().find(|column| column.path().parts().len() > 1) {
        return Err(failed(is_nested(name, &nested.path().parts()[0]).to_string().into()));
    }
    let (selection, most) = selection.unzip();
    let library = Library {
        store: Store::new(file, Arc::new(Expansion::new(bytes))),
        metadata: Arc::new(metadata),
        checksums: chunks,
        row_groups,
        slot: FaultSlot::default(),
        writes_out: true,
    };
    let rows = CheckedRows::open(name, &library, ProjectionMask::all(), None, BATCH_ROWS, selection);
    let (mut batches, mut held) = (Vec::new(), 0);
    for batch in rows.map_err(|finding| damaged_file(name, &finding))? {
        let batch = batch.map_err(|finding| damaged_file(name, &finding))?;
        held += batch.get_array_memory_size() as u64;
        let checked = most.map_or(Ok(()), |most| most.check(held));
        checked.map_err(|exceeded| TraceError::from(Finding::over_budget(name, &exceeded)))?;
        batches.push(batch);
    }
    let Some(first) = batches.first() else { return Ok(Vec::new()) };
    contained(|| concat_batches(&first.schema(), &batches).map_err(|error| error.to_string()))
        .and_then(|rows| episodes(&rows?))
        .map_err(|fault| failed(fault.into()))
}

fn unreadable(name: &str, source: Box<dyn std::error::Error + Send + Sync>) -> TraceError {
    TraceError::Part { file: name.to_owned(), source }
}

fn episodes(rows: &RecordBatch) -> Result<Vec<EpisodeRows>, String> {
    let column = |name: &str, kind: &DataType| {
        let column = rows.column_by_name(name).ok_or_else(|| format!("there is no column `{name}`"))?;
        cast(column, kind).map_err(|fault| format!("the column `{name}`: {fault}"))
    };
    let (ids, seeds, runs) =
        (column("episode_id", &DataType::Utf8)?, column("seed", &DataType::Int64)?, column("run", &DataType::Int64)?);
    let (ids, seeds, runs) =
        (ids.as_string::<i32>(), seeds.as_primitive::<Int64Type>(), runs.as_primitive::<Int64Type>());
    let repetitions = rows.column_by_name("repetition").and_then(|column| cast(column, &DataType::Int64).ok());
    let repetitions = repetitions.map(|column| column.as_primitive::<Int64Type>().clone());
    let mut found = Vec::new();
    let mut start = 0;
    for end in 1..=ids.len() {
        if end == ids.len() || ids.value(end) != ids.value(start) {
            found.push(EpisodeRows {
                episode_id: ids.value(start).to_owned(),
                seed: seeds.value(start),
                run: runs.value(start),
                repetition: repetitions
                    .as_ref()
                    .filter(|column| column.is_valid(start))
                    .map_or(1, |column| column.value(start)),
                rows: rows.slice(start, end - start),
            });
            start = end;
        }
    }
    Ok(found)
}

pub fn rows(episode: &Episode, columns: &OptionalColumns) -> Result<EpisodeRows, TraceError> {
    let (columns, undeclared) = columns.split();
    write::check(episode, &columns, &undeclared, None)?;
    let mut gathered = Gathered::of_columns(columns.iter().copied());
    write::gather(&mut gathered, &columns, episode);
    let rows = gathered.take().map_err(TraceError::Memory)?;
    let (seed, run, repetition) = (episode.seed.into(), episode.run.into(), episode.repetition.unwrap_or(1).into());
    Ok(EpisodeRows { episode_id: episode.episode_id.clone(), seed, run, repetition, rows })
}

/// Replaces the trace at `path` by one with these episodes, in this order.
pub fn write(path: &Path, recording: Option<&serde_json::Value>, episodes: &[EpisodeRows]) -> Result<(), TraceError> {
    write_in(replace::folder_of(path), path, recording, episodes)
}

/// Like [`write()`], with the temporary file in `scratch`, a folder of the same file system.
pub fn write_in(
    scratch: &Path,
    path: &Path,
    recording: Option<&serde_json::Value>,
    episodes: &[EpisodeRows],
) -> Result<(), TraceError> {
    let failed = |source: Box<dyn std::error::Error + Send + Sync>| TraceError::write(path, source);
    let episodes = all_hashed(episodes)?;
    let Some(first) = episodes.first() else { return Err(failed("there is no episode to write".into())) };
    let schema = first.rows.schema();
    if let Some(other) = episodes.iter().find(|episode| !same_columns(&schema, &episode.rows.schema())) {
        return Err(failed(format!("`{}` has other columns than `{}`", other.episode_id, first.episode_id).into()));
    }
    let file = NewFile::create_in(scratch, path).map_err(|error| failed(error.into()))?;
    let encoded = RowGroups::new(file, &schema, recording).and_then(|mut row_groups| {
        episodes.iter().try_for_each(|episode| row_groups.write(&episode.rows))?;
        row_groups.finish(None)
    });
    let file = encoded.map_err(|error| failed(error.into()))?;
    file.commit().map_err(|error| failed(error.into()))
}

fn all_hashed(episodes: &[EpisodeRows]) -> Result<Cow<'_, [EpisodeRows]>, TraceError> {
    let has_hash = |episode: &EpisodeRows| episode.rows.column_by_name(EPISODE_HASH).is_some();
    if episodes.iter().all(has_hash) || !episodes.iter().any(has_hash) {
        return Ok(Cow::Borrowed(episodes));
    }
    episodes.iter().map(|episode| if has_hash(episode) { Ok(episode.clone()) } else { episode.hashed() }).collect()
}

fn same_columns(a: &SchemaRef, b: &SchemaRef) -> bool {
    let columns = |schema: &SchemaRef| {
        schema.fields().iter().map(|field| (field.name().clone(), field.data_type().clone())).collect::<Vec<_>>()
    };
    columns(a) == columns(b)
}
