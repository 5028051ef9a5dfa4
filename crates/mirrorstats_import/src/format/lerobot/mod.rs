//! LeRobot: `eval_info.json` of an evaluation gives one row per episode, a data set one row per frame.

pub(crate) mod data_set;

use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, AsArray as _, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type, Int64Type};
use indexmap::IndexMap;
use serde_json::{Map, Value, json};

use super::json::PythonJson;
use super::{RowSink, parquet};
use crate::error::ImportError;

type FrameColumns = IndexMap<String, ArrayRef>;

/// Frame columns with dots in their names, and their names here.
const FRAME: [(&str, &str); 4] =
    [("next.reward", "reward"), ("next.success", "success"), ("next.done", "done"), ("next.truncated", "truncated")];

pub(super) fn read(mut file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let mut start = [0; 4];
    let is_parquet = file.read_exact(&mut start).is_ok() && start == *b"PAR1";
    file.rewind().map_err(ImportError::read(&rows.file))?;
    if is_parquet { read_frames(file, rows, |columns| columns) } else { read_evaluation(file, rows) }
}

fn read_evaluation(file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let help = "name the `eval_info.json` that `lerobot-eval` writes";
    let expected = "an evaluation of LeRobot, with `per_episode` or `per_task`";
    let info: Value = serde_json::from_reader(PythonJson::new(file))
        .map_err(|error| rows.fault("", expected, error.to_string(), help))?;
    if let Some(episodes) = info["per_episode"].as_array() {
        return episodes.iter().try_for_each(|episode| add_episode(&episode["episode_ix"], "", episode, rows));
    }
    let tasks = info["per_task"].as_array();
    for task in tasks.ok_or_else(|| rows.fault("", expected, "neither", help))? {
        let metrics = &task["metrics"];
        let name = format!("{}/{}", task["task_group"].as_str().unwrap_or_default(), task["task_id"]);
        let count = metrics["successes"].as_array().map_or(0, Vec::len);
        for at in 0..count {
            let of = |list: &str| metrics[list][at].clone();
            let episode = json!({
                "task_group": task["task_group"], "task_id": task["task_id"], "task": name,
                "sum_reward": of("sum_rewards"), "max_reward": of("max_rewards"), "success": of("successes"),
            });
            add_episode(&json!(at), &format!("{name}/"), &episode, rows)?;
        }
    }
    Ok(())
}

fn add_episode(index: &Value, prefix: &str, episode: &Value, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let run = index.as_i64().map(|index| index.saturating_add(1));
    let id = format!("{}/{prefix}{index}", rows.digits);
    let mut row: Map<String, Value> = [("episode_id", json!(id)), ("run", json!(run)), ("t", json!(1))]
        .map(|(key, value)| (key.to_owned(), value))
        .into_iter()
        .collect();
    row.extend(episode.as_object().cloned().unwrap_or_default());
    rows.add_object(&row)
}

/// Reads frames in batches; `complete` may add columns.
fn read_frames(
    file: File,
    rows: &mut RowSink<'_>,
    mut complete: impl FnMut(FrameColumns) -> FrameColumns,
) -> Result<(), ImportError> {
    let mut changes = Changes::default();
    parquet::each_batch(file, rows, &|column| column == "action", |batch, rows| {
        let [Some(episodes), Some(frames)] = ["episode_index", "frame_index"].map(|name| integers(&batch, name)) else {
            let help = "name the files below `data` of a data set, or import other Parquet with `--from parquet`";
            return Err(rows.fault("", "frames of LeRobot, with `episode_index` and `frame_index`", "none", help));
        };
        let own = batch.schema_ref().fields().iter().zip(batch.columns());
        let own = own.map(|(field, values)| (renamed(field.name()), ArrayRef::clone(values)));
        let mut columns = identity(&episodes, &frames, &rows.digits);
        if let Some(actions) = batch.column_by_name("action") {
            let change = changes.distances(&episodes, &frames, actions);
            columns.insert("action_change".to_owned(), Arc::new(change));
        }
        columns.extend(own);
        let columns = complete(columns).into_iter().map(|(name, values)| (name, values, true));
        let table = RecordBatch::try_from_iter_with_nullable(columns);
        rows.add_table(
            &table.map_err(|error| rows.fault("", "columns of one length", error.to_string(), "write it anew"))?,
        )
    })
}

fn renamed(column: &str) -> String {
    FRAME.iter().find(|(name, _)| *name == column).map_or(column, |(_, name)| name).to_owned()
}

fn integers(table: &RecordBatch, name: &str) -> Option<Int64Array> {
    let column = table.column_by_name(name).filter(|column| column.data_type().is_integer())?;
    Some(cast(column, &DataType::Int64).ok()?.as_primitive::<Int64Type>().clone())
}

fn identity(episodes: &Int64Array, frames: &Int64Array, digits: &str) -> FrameColumns {
    let ids: StringArray = episodes.iter().map(|episode| Some(format!("{digits}/{}", episode?))).collect();
    let next = |numbers: &Int64Array| numbers.unary::<_, Int64Type>(|number| number.saturating_add(1));
    let columns: [(_, ArrayRef); 3] =
        [("episode_id", Arc::new(ids)), ("run", Arc::new(next(episodes))), ("t", Arc::new(next(frames)))];
    columns.map(|(name, values)| (name.to_owned(), values)).into_iter().collect()
}

/// How far each action is from that of the frame before, which may be in an earlier batch.
#[derive(Default)]
struct Changes {
    before: Option<(i64, i64, Vec<f64>)>,
}

impl Changes {
    fn distances(&mut self, episodes: &Int64Array, frames: &Int64Array, actions: &ArrayRef) -> Float64Array {
        (0..actions.len()).map(|row| self.next(episodes, frames, actions, row)).collect()
    }

    fn next(&mut self, episodes: &Int64Array, frames: &Int64Array, actions: &ArrayRef, row: usize) -> Option<f64> {
        let now = numbers(actions, row).filter(|_| episodes.is_valid(row) && frames.is_valid(row));
        let now = now.map(|action| (episodes.value(row), frames.value(row), action));
        let before = std::mem::replace(&mut self.before, now);
        let ((of, at, before), (episode, frame, action)) = (before?, self.before.as_ref()?);
        (of == *episode && at + 1 == *frame).then(|| distance(&before, action)).flatten()
    }
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

fn distance(a: &[f64], b: &[f64]) -> Option<f64> {
    (a.len() == b.len()).then(|| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt())
}
