//! A data set of LeRobot, version 3: a folder with `meta/info.json`, tasks, episodes, and the frames below `data`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::parquet::schema::types::Type;
use arrow::array::{Array as _, ArrayRef, AsArray as _, Float64Array, Int64Array, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Int64Type};
use serde_json::{Map, Value};

use super::super::{RowSink, parquet};
use super::{FrameColumns, integers, read_frames};
use crate::error::ImportError;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::{hash, input};
use mirrorstats_trace::inputs::{Input, traces_at};

const INFO: &str = "meta/info.json";
/// The features of a robot with many cameras take tens of kilobytes.
const LARGEST_INFO: Limit = Limit::new("bytes of meta/info.json", 16 << 20);

pub(crate) fn is_data_set(folder: &Path) -> bool {
    folder.join(INFO).is_file()
}

/// The hash of a data set: of its metadata and frame files, with their paths in the folder.
pub(crate) fn hash_of(folder: &Path) -> Result<String, ImportError> {
    let mut lines = Vec::new();
    let files = [vec![folder.join(INFO), folder.join("meta/tasks.parquet")], below(folder, "meta/episodes")?];
    for path in files.into_iter().flatten().chain(below(folder, "data")?).filter(|path| path.is_file()) {
        let failed = || ImportError::read(&Input::new(&path).name);
        let sha256 = hash::of_reader(input::open(&path).map_err(failed())?).map_err(failed())?;
        let place = path.strip_prefix(folder).unwrap_or(&path).display();
        lines.push(format!("{sha256}  {place}\n"));
    }
    Ok(hash::of_bytes(lines.concat().as_bytes()))
}

/// Adds the frames of all episodes with their tasks, and checks that none is missing.
pub(crate) fn read_folder(folder: &Path, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let constants = constants(folder, rows)?;
    let tasks = tasks(folder, rows)?;
    let mut left = frames_of_episodes(folder, rows)?;
    for path in below(folder, "data")? {
        each_file(&path, rows, |file, rows| {
            read_frames(file, rows, |mut columns| {
                for episode in numbers(&columns, "episode_index").iter().flatten() {
                    if let Some(frames) = left.get_mut(&episode) {
                        *frames -= 1;
                    }
                }
                let indices = numbers(&columns, "task_index");
                let task = |index: Option<i64>| tasks.get(&index?).map(String::as_str);
                let task =
                    (!tasks.is_empty()).then(|| Arc::new(indices.iter().map(task).collect::<StringArray>()) as _);
                let rows = columns["t"].len();
                let constants = constants.iter().map(|(name, value)| (name.clone(), repeated(value, rows)));
                for (name, values) in constants.chain(task.map(|task| ("task".to_owned(), task))) {
                    columns.entry(name).or_insert(values);
                }
                columns
            })
        })?;
    }
    let Some((episode, frames)) = left.into_iter().find(|(_, frames)| *frames != 0) else { return Ok(()) };
    let found = if frames > 0 { format!("{frames} fewer") } else { format!("{} more", -frames) };
    let help = "copy the data set again, or name the files below `data` that are to be imported";
    Err(rows.fault("data", &format!("the frames of episode {episode}, as `meta/episodes` counts them"), found, help))
}

pub(crate) fn bytes_of(folder: &Path) -> Result<u64, ImportError> {
    let bytes = |path: PathBuf| path.metadata().map(|about| about.len()).unwrap_or_default();
    Ok(below(folder, "data")?.into_iter().map(bytes).sum())
}

fn constants(folder: &Path, rows: &RowSink<'_>) -> Result<Map<String, Value>, ImportError> {
    let path = folder.join(INFO);
    let text = input::text(&path, LARGEST_INFO).map_err(ImportError::read(&Input::new(&path).name))?;
    let expected = "a data set of LeRobot, version 3, with `codebase_version`";
    let help = "convert an older one with LeRobot's own script, or name its files below `data`";
    let info: Value =
        serde_json::from_str(&text).map_err(|error| rows.fault(INFO, expected, error.to_string(), help))?;
    match info["codebase_version"].as_str() {
        Some(version) if version.starts_with("v3") => {}
        Some(version) => return Err(rows.fault(INFO, expected, format!("version {version}"), help)),
        None => return Err(rows.fault(INFO, expected, "none", help)),
    }
    let known = ["fps", "robot_type"].map(|key| (key.to_owned(), info[key].clone()));
    Ok(known.into_iter().filter(|(_, value)| !value.is_null()).collect())
}

fn repeated(value: &Value, rows: usize) -> ArrayRef {
    match (value.as_i64(), value.as_f64(), value.as_str()) {
        (Some(number), ..) => Arc::new(Int64Array::from_value(number, rows)),
        (_, Some(number), _) => Arc::new(Float64Array::from_value(number, rows)),
        (.., text) => Arc::new(StringArray::from(vec![text; rows])),
    }
}

fn numbers(columns: &FrameColumns, name: &str) -> Int64Array {
    let column = columns.get(name).filter(|column| column.data_type().is_integer());
    let numbers = column.and_then(|column| cast(column, &DataType::Int64).ok());
    numbers
        .map_or_else(|| Int64Array::new_null(columns["t"].len()), |numbers| numbers.as_primitive::<Int64Type>().clone())
}

/// Tasks by number. Pandas names the column of texts `__index_level_0__` if it has no name.
fn tasks(folder: &Path, rows: &mut RowSink<'_>) -> Result<BTreeMap<i64, String>, ImportError> {
    let mut tasks = BTreeMap::new();
    let path = folder.join("meta/tasks.parquet");
    if path.is_file() {
        each_file(&path, rows, |file, rows| {
            parquet::each_batch(file, rows, &|_| false, |batch, _| {
                let text = batch.columns().iter().find_map(|column| column.as_string_opt::<i32>());
                let pairs = integers(&batch, "task_index").zip(text);
                let pairs = pairs.iter().flat_map(|(numbers, texts)| numbers.iter().zip(texts.iter()));
                tasks.extend(pairs.filter_map(|(number, text)| Some((number?, text?.to_owned()))));
                Ok(())
            })
        })?;
    }
    Ok(tasks)
}

/// The number of frames of each episode. The files also hold statistics of each feature.
fn frames_of_episodes(folder: &Path, rows: &mut RowSink<'_>) -> Result<BTreeMap<i64, i64>, ImportError> {
    let mut lengths = BTreeMap::new();
    for path in below(folder, "meta/episodes")? {
        each_file(&path, rows, |file, rows| {
            let choose = |root: &Type, _, _: &mut RowSink<'_>| ["episode_index", "length"].contains(&root.name());
            parquet::each_batch_of(file, rows, choose, |batch, _| {
                let pairs = integers(&batch, "episode_index").zip(integers(&batch, "length"));
                let pairs = pairs.iter().flat_map(|(episodes, lengths)| episodes.iter().zip(lengths));
                lengths.extend(pairs.filter_map(|(episode, length)| episode.zip(length)));
                Ok(())
            })
        })?;
    }
    Ok(lengths)
}

fn below(folder: &Path, name: &str) -> Result<Vec<PathBuf>, ImportError> {
    let at = folder.join(name);
    let mut files = if at.is_dir() { traces_at(&at)? } else { Vec::new() };
    files.sort();
    Ok(files)
}

fn each_file(
    path: &Path,
    rows: &mut RowSink<'_>,
    read: impl FnOnce(std::fs::File, &mut RowSink<'_>) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let name = Input::new(path).name;
    let file = input::open(path).map_err(ImportError::read(&name))?;
    let whole = std::mem::replace(&mut rows.file, name);
    read(file, rows)?;
    rows.file = whole;
    Ok(())
}
