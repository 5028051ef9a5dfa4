//! Writes traces from the rows of episodes, without reading or changing values.
//!
//! Rule: the same episodes in the same order give the same bytes, whatever their files.

use std::path::Path;

use arrow::datatypes::SchemaRef;

use crate::episodes::episode::Episode;
use crate::error::TraceError;
use crate::read::episode_rows::EpisodeRows;
use crate::write::row_groups::{Gathered, RowGroups};
use crate::write::{self, OptionalColumns};
use mirrorstats_exact::replace::{self, NewFile};

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

/// Compares names and types: whether a column may be null is no difference.
fn same_columns(a: &SchemaRef, b: &SchemaRef) -> bool {
    let columns = |schema: &SchemaRef| {
        schema.fields().iter().map(|field| (field.name().clone(), field.data_type().clone())).collect::<Vec<_>>()
    };
    columns(a) == columns(b)
}
