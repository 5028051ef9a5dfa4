//! LeRobot: `eval_info.json` of an evaluation gives one row per episode, a data set one row per frame.

pub(in crate::import) mod data_set;

use std::fs::File;
use std::io::{Read as _, Seek as _};

use serde_json::{Map, Value, json};

use super::json::WithoutNan;
use super::{RowSink, parquet};
use crate::import::error::ImportError;

/// Frame columns with dots in their names, and their names here.
const FRAME: [(&str, &str); 4] =
    [("next.reward", "reward"), ("next.success", "success"), ("next.done", "done"), ("next.truncated", "truncated")];

pub(super) fn read(mut file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let mut start = [0; 4];
    let is_parquet = file.read_exact(&mut start).is_ok() && start == *b"PAR1";
    file.rewind().map_err(ImportError::read(&rows.file))?;
    if is_parquet { read_frames(file, rows, |_| ()) } else { read_evaluation(file, rows) }
}

fn read_evaluation(file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let help = "name the `eval_info.json` that `lerobot-eval` writes";
    let expected = "an evaluation of LeRobot, with `per_episode` or `per_task`";
    let info: Value = serde_json::from_reader(WithoutNan::new(file))
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
    let mut row = identity(index, &format!("{}/{prefix}", rows.digits), 1);
    row.extend(episode.as_object().cloned().unwrap_or_default());
    rows.add_object(&row)
}

fn read_frames(
    file: File,
    rows: &mut RowSink<'_>,
    mut complete: impl FnMut(&mut Map<String, Value>),
) -> Result<(), ImportError> {
    let mut before = (Value::Null, 0, Value::Null);
    parquet::each_row(file, rows, |mut frame, rows| {
        let Some(index) = frame.get("frame_index").and_then(Value::as_i64) else {
            let help = "name the files below `data` of a data set, or import other Parquet with `--from parquet`";
            return Err(rows.fault("", "frames of LeRobot, with `episode_index` and `frame_index`", "none", help));
        };
        complete(&mut frame);
        let episode = frame.get("episode_index").cloned().unwrap_or_default();
        let mut row = identity(&episode, &format!("{}/", rows.digits), index.saturating_add(1));
        if let Some(action) = frame.get("action") {
            let follows = before.0 == episode && before.1 + 1 == index;
            row.insert("action_change".to_owned(), json!(follows.then(|| distance(&before.2, action)).flatten()));
            before = (episode, index, action.clone());
        }
        for (key, name) in FRAME {
            row.extend(frame.remove(key).map(|value| (name.to_owned(), value)));
        }
        row.extend(frame);
        rows.add_object(&row)
    })
}

fn identity(episode: &Value, prefix: &str, t: i64) -> Map<String, Value> {
    let run = episode.as_i64().map(|index| index.saturating_add(1));
    let columns = [("episode_id", json!(format!("{prefix}{episode}"))), ("run", json!(run)), ("t", json!(t))];
    columns.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}

fn distance(a: &Value, b: &Value) -> Option<f64> {
    let (a, b) = (a.as_array()?, b.as_array()?);
    let squares = a.iter().zip(b).map(|(a, b)| Some((a.as_f64()? - b.as_f64()?).powi(2)));
    if a.len() == b.len() { squares.sum::<Option<f64>>().map(f64::sqrt) } else { None }
}
