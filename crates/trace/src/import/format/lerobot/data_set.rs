//! A data set of LeRobot, version 3: a folder with `meta/info.json`, tasks, episodes, and the frames below `data`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::super::{RowSink, parquet};
use super::read_frames;
use crate::import::error::ImportError;
use crate::inputs::{Input, traces_at};
use exact::budget::Limit;
use exact::{hash, input};

const INFO: &str = "meta/info.json";
/// The features of a robot with many cameras take tens of kilobytes.
const LARGEST_INFO: Limit = Limit::new("bytes of meta/info.json", 16 << 20);

pub(in crate::import) fn is_data_set(folder: &Path) -> bool {
    folder.join(INFO).is_file()
}

/// The hash of a data set: of its metadata and frame files, with their paths in the folder.
pub(in crate::import) fn hash_of(folder: &Path) -> Result<String, ImportError> {
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
pub(in crate::import) fn read_folder(folder: &Path, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let constants = constants(folder, rows)?;
    let tasks = tasks(folder, rows)?;
    let mut left = frames_of_episodes(folder, rows)?;
    for path in below(folder, "data")? {
        each_file(&path, rows, |file, rows| {
            read_frames(file, rows, |frame| {
                let number = |key: &str| frame.get(key).and_then(Value::as_i64);
                let task = number("task_index").and_then(|index| tasks.get(&index));
                if let Some(frames) = number("episode_index").and_then(|episode| left.get_mut(&episode)) {
                    *frames -= 1;
                }
                let own = constants.clone().into_iter().chain(task.map(|task| ("task".to_owned(), json!(task))));
                for (key, value) in own.filter(|(key, _)| !frame.contains_key(key)).collect::<Vec<_>>() {
                    frame.insert(key, value);
                }
            })
        })?;
    }
    let Some((episode, frames)) = left.into_iter().find(|(_, frames)| *frames != 0) else { return Ok(()) };
    let found = if frames > 0 { format!("{frames} fewer") } else { format!("{} more", -frames) };
    let help = "copy the data set again, or name the files below `data` that are to be imported";
    Err(rows.fault("data", &format!("the frames of episode {episode}, as `meta/episodes` counts them"), found, help))
}

/// The values in `meta/info.json` that apply to all frames.
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

/// Tasks by number. Pandas names the column of texts `__index_level_0__` if it has no name.
fn tasks(folder: &Path, rows: &mut RowSink<'_>) -> Result<BTreeMap<i64, String>, ImportError> {
    let mut tasks = BTreeMap::new();
    let path = folder.join("meta/tasks.parquet");
    if path.is_file() {
        each_file(&path, rows, |file, rows| {
            parquet::each_row(file, rows, |row, _| {
                let text = row.values().find_map(Value::as_str);
                tasks.extend(row.get("task_index").and_then(Value::as_i64).zip(text.map(str::to_owned)));
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
            parquet::each_row_of(file, rows, &["episode_index", "length"], |row, _| {
                let number = |key: &str| row.get(key).and_then(Value::as_i64);
                lengths.extend(number("episode_index").zip(number("length")));
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

/// Reads each file; faults name the file.
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
