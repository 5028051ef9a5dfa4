//! LeRobot's frames: files below `data`, and the folder of a data set with `meta/info.json`, tasks and episodes, which are
//! Parquet in version 3 and JSON Lines in version 2. Only what a mapping cannot say is here: distances of actions, tasks
//! and counts in other files.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::parquet::schema::types::Type;
use arrow::array::{Array as _, ArrayRef, AsArray as _, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type, Int64Type};
use serde_json::Value;

use super::parquet;
use crate::arrays::{array, table};
use crate::error::ImportError;
use crate::rows::Rows;
use crate::value::Cell;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::{hash, input};
use mirrorstats_trace::inputs::{Input, traces_at};

const INFO: &str = "meta/info.json";
/// The features of a robot with many cameras take tens of kilobytes.
const LARGEST_INFO: Limit = Limit::new("bytes of meta/info.json", 16 << 20);

const TASKS_OF_V2: &str = "meta/tasks.jsonl";
const EPISODES_OF_V2: &str = "meta/episodes.jsonl";
/// A hundred thousand episodes take some 10 MB.
const LARGEST_LINES: Limit = Limit::new("bytes of tasks or episodes", 256 << 20);

type NamedArrays = Vec<(String, ArrayRef)>;

/// The hash of a data set: of its metadata and frame files, with their paths in the folder.
pub(crate) fn hash_of(folder: &Path) -> Result<String, ImportError> {
    let mut lines = Vec::new();
    let one_each = [INFO, "meta/tasks.parquet", TASKS_OF_V2, EPISODES_OF_V2].map(|name| folder.join(name));
    let files = [one_each.to_vec(), below(folder, "meta/episodes")?];
    for path in files.into_iter().flatten().chain(below(folder, "data")?).filter(|path| path.is_file()) {
        let failed = || ImportError::read(&Input::new(&path).name);
        let sha256 = hash::of_reader(input::open(&path).map_err(failed())?).map_err(failed())?;
        let place = path.strip_prefix(folder).unwrap_or(&path).display();
        lines.push(format!("{sha256}  {place}\n"));
    }
    Ok(hash::of_bytes(lines.concat().as_bytes()))
}

pub(crate) fn bytes_of(folder: &Path) -> Result<u64, ImportError> {
    let bytes = |path: PathBuf| path.metadata().map(|about| about.len()).unwrap_or_default();
    Ok(below(folder, "data")?.into_iter().map(bytes).sum())
}

/// Adds the frames of all episodes with their tasks, and checks that none is missing.
pub(crate) fn read_folder(folder: &Path, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    let constants = constants(folder, rows)?;
    let tasks: BTreeMap<i64, String> = tasks(folder, rows)?;
    let mut left = frames_of_episodes(folder, rows)?;
    for path in below(folder, "data")? {
        each_file(&path, rows, |file, rows| {
            read_frames(file, rows, &mut |frames| {
                for episode in integers(frames, "episode_index").iter().flatten().flatten() {
                    if let Some(frames) = left.get_mut(&episode) {
                        *frames -= 1;
                    }
                }
                let repeated = |value: &Value| array(vec![Cell::of_json(value); frames.num_rows()]);
                let mut columns: NamedArrays =
                    constants.iter().map(|(name, value)| ((*name).to_owned(), repeated(value))).collect();
                if let Some(numbers) = integers(frames, "task_index").filter(|_| !tasks.is_empty()) {
                    let texts = numbers.iter().map(|number| tasks.get(&number?).map(String::as_str));
                    columns.push(("task".to_owned(), Arc::new(texts.collect::<StringArray>())));
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

fn constants(folder: &Path, rows: &Rows<'_>) -> Result<Vec<(&'static str, Value)>, ImportError> {
    let path = folder.join(INFO);
    let text = input::text(&path, LARGEST_INFO).map_err(ImportError::read(&Input::new(&path).name))?;
    let expected = "a data set of LeRobot, version 2 or 3, with `codebase_version`";
    let help = "convert an older one with LeRobot's own script, or name its files below `data`";
    let info: Value =
        serde_json::from_str(&text).map_err(|error| rows.fault(INFO, expected, error.to_string(), help))?;
    match info["codebase_version"].as_str() {
        Some(version) if version.starts_with("v3") || version.starts_with("v2") => {}
        Some(version) => return Err(rows.fault(INFO, expected, format!("version {version}"), help)),
        None => return Err(rows.fault(INFO, expected, "none", help)),
    }
    let known = ["fps", "robot_type"].map(|key| (key, info[key].clone()));
    Ok(known.into_iter().filter(|(_, value)| !value.is_null()).collect())
}

/// Tasks by number. Pandas names the column of texts `__index_level_0__` if it has no name.
fn tasks(folder: &Path, rows: &mut Rows<'_>) -> Result<BTreeMap<i64, String>, ImportError> {
    let task = |line: &Value| Some((line["task_index"].as_i64()?, line["task"].as_str()?.to_owned()));
    let mut tasks: BTreeMap<_, _> = lines(folder, TASKS_OF_V2, rows)?.iter().filter_map(task).collect();
    let path = folder.join("meta/tasks.parquet");
    if path.is_file() {
        each_file(&path, rows, |file, rows| {
            parquet::each_batch(file, rows, &[], |batch, _| {
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
fn frames_of_episodes(folder: &Path, rows: &mut Rows<'_>) -> Result<BTreeMap<i64, i64>, ImportError> {
    let length = |line: &Value| Some((line["episode_index"].as_i64()?, line["length"].as_i64()?));
    let mut lengths: BTreeMap<_, _> = lines(folder, EPISODES_OF_V2, rows)?.iter().filter_map(length).collect();
    for path in below(folder, "meta/episodes")? {
        each_file(&path, rows, |file, rows| {
            let choose = |root: &Type, _, _: &mut Rows<'_>| ["episode_index", "length"].contains(&root.name());
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

/// The objects of JSON Lines; none if there is no such file.
fn lines(folder: &Path, name: &str, rows: &Rows<'_>) -> Result<Vec<Value>, ImportError> {
    let path = folder.join(name);
    if !path.is_file() {
        return Ok(Vec::new());
    }
    let text = input::text(&path, LARGEST_LINES).map_err(ImportError::read(&Input::new(&path).name))?;
    let help = "copy the data set again";
    let object = |line| serde_json::from_str(line);
    let objects = text.lines().filter(|line| !line.trim().is_empty()).map(object).collect::<Result<_, _>>();
    objects.map_err(|error| rows.fault(name, "strict JSON in each line", error.to_string(), help))
}

fn below(folder: &Path, name: &str) -> Result<Vec<PathBuf>, ImportError> {
    let at = folder.join(name);
    let mut files = if at.is_dir() { traces_at(&at)? } else { Vec::new() };
    files.sort();
    Ok(files)
}

fn each_file(
    path: &Path,
    rows: &mut Rows<'_>,
    read: impl FnOnce(File, &mut Rows<'_>) -> Result<(), ImportError>,
) -> Result<(), ImportError> {
    let name = Input::new(path).name;
    let file = input::open(path).map_err(ImportError::read(&name))?;
    let whole = std::mem::replace(&mut rows.file, name);
    read(file, rows)?;
    rows.file = whole;
    Ok(())
}

/// Reads frames in batches; `more` gives columns that they lack.
pub(super) fn read_frames(
    file: File,
    rows: &mut Rows<'_>,
    more: &mut dyn FnMut(&RecordBatch) -> NamedArrays,
) -> Result<(), ImportError> {
    let mut before = None;
    parquet::each_batch(file, rows, &["action"], |batch, rows| {
        let [Some(episodes), Some(frames)] = ["episode_index", "frame_index"].map(|name| integers(&batch, name)) else {
            let help = "name the files below `data` of a data set, or import other Parquet with `--from parquet`";
            return Err(rows.fault("", "frames of LeRobot, with `episode_index` and `frame_index`", "none", help));
        };
        let names = batch.schema_ref().fields().iter().map(|field| field.name().clone());
        let mut columns: NamedArrays = names.zip(batch.columns().iter().cloned()).collect();
        let change = batch.column_by_name("action").map(|actions| {
            let changes = (0..actions.len()).map(|row| {
                let now = numbers(actions, row).filter(|_| episodes.is_valid(row) && frames.is_valid(row));
                let now = now.map(|action| (episodes.value(row), frames.value(row), action));
                let last = std::mem::replace(&mut before, now);
                change(last.as_ref()?, before.as_ref()?)
            });
            ("action_change".to_owned(), Arc::new(changes.collect::<Float64Array>()) as ArrayRef)
        });
        for (name, values) in change.into_iter().chain(more(&batch)) {
            if !columns.iter().any(|(known, _)| *known == name) {
                columns.push((name, values));
            }
        }
        rows.add_table(&table(columns, batch.num_rows()))
    })
}

fn integers(table: &RecordBatch, name: &str) -> Option<Int64Array> {
    let column = table.column_by_name(name).filter(|column| column.data_type().is_integer())?;
    Some(cast(column, &DataType::Int64).ok()?.as_primitive::<Int64Type>().clone())
}

type Frame = (i64, i64, Vec<f64>);

/// The distance of an action from that of the frame before, which may be in an earlier batch.
fn change((of, at, before): &Frame, (episode, frame, action): &Frame) -> Option<f64> {
    let is_next = of == episode && at + 1 == *frame && before.len() == action.len();
    is_next.then(|| before.iter().zip(action).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt())
}

/// The numbers of a list; `None` if the column has no lists of numbers, or a null in this one.
fn numbers(lists: &ArrayRef, row: usize) -> Option<Vec<f64>> {
    let list = match lists.data_type() {
        _ if lists.is_null(row) => return None,
        DataType::List(_) => lists.as_list::<i32>().value(row),
        DataType::FixedSizeList(..) => lists.as_fixed_size_list().value(row),
        _ => return None,
    };
    let is_number = list.data_type().is_numeric() && list.null_count() == 0;
    let numbers = cast(&list, &DataType::Float64).ok().filter(|_| is_number)?;
    Some(numbers.as_primitive::<Float64Type>().values().to_vec())
}
