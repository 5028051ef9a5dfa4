//! Logs of other harnesses: made here by their own packages, or for LeRobot written in its documented layout.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::datatypes::{DataType, Field, Schema};
use arrow::json::ReaderBuilder;
use serde_json::{Value, json};

use super::files::repository;
use super::need;
use super::program::{clean, succeeds};
use super::traces::write_rows;

/// Writes logs of two agents into this folder with Inspect's mock model; see the script.
pub fn inspect(folder: &Path) {
    made_by("inspect_logs.py", folder);
}

/// Writes logs of two mock policies into this folder with inspect-robots.
pub fn inspect_robots(folder: &Path) {
    made_by("robots_logs.py", folder);
}

fn made_by(script: &str, folder: &Path) {
    let mut command = clean(Command::new(need::python()), folder.parent().unwrap());
    command.env("PYTHONPATH", need::harnesses()).env("HOME", folder.parent().unwrap());
    succeeds(command.arg(repository().join("tests/harness/logs").join(script)).arg(folder));
}

/// Writes `lerobot-eval`'s result file, which says which episodes were solved.
pub fn lerobot_evaluation(path: &Path, successes: &[bool]) {
    let episode = |(at, success): (usize, &bool)| {
        json!({ "episode_ix": at, "sum_reward": f64::from(u8::from(*success)) + 0.5, "max_reward": null,
                "success": success, "seed": 1000 + at })
    };
    let episodes: Vec<Value> = successes.iter().enumerate().map(episode).collect();
    let info = json!({ "per_episode": episodes, "aggregated": { "pc_success": 50.0 } });
    fs::write(path, info.to_string().replace("null", "NaN")).unwrap();
}

/// Writes a LeRobot data set, version 3: `meta` as its `lerobot.datasets.utils` and pandas write it, and
/// `data/chunk-000/file-000.parquet` with the frames of all episodes. Episode `i` is solved at frame `solved[i]`, or
/// never. Its actions are smooth, or jump at each frame.
pub fn lerobot_data_set(folder: &Path, solved: &[Option<u32>], is_smooth: bool) {
    const FRAMES: u32 = 8;
    let frame = |episode: usize, solved: Option<u32>, at: u32| {
        let side = if is_smooth { 0.1 } else { f64::from(at % 2) * 3.0 };
        json!({
            "observation.state": [0.5, f64::from(at)], "action": [side, side + f64::from(at) * 0.25],
            "timestamp": f64::from(at) / 10.0, "frame_index": at, "episode_index": episode,
            "index": u32::try_from(episode).unwrap() * FRAMES + at, "task_index": 0,
            "next.reward": 0.0, "next.success": solved == Some(at), "next.done": at + 1 == FRAMES,
        })
    };
    let of_episode = |(episode, solved): (usize, &Option<u32>)| -> Vec<Value> {
        (0..FRAMES).map(|at| frame(episode, *solved, at)).collect()
    };
    let frames: Vec<Value> = solved.iter().enumerate().flat_map(of_episode).collect();
    let pair = || DataType::new_list(DataType::Float32, true);
    let schema = Schema::new(
        [
            ("observation.state", pair()),
            ("action", pair()),
            ("timestamp", DataType::Float32),
            ("frame_index", DataType::Int64),
            ("episode_index", DataType::Int64),
            ("index", DataType::Int64),
            ("task_index", DataType::Int64),
            ("next.reward", DataType::Float32),
            ("next.success", DataType::Boolean),
            ("next.done", DataType::Boolean),
        ]
        .map(|(name, kind)| Field::new(name, kind, true))
        .to_vec(),
    );
    let path = folder.join("data/chunk-000/file-000.parquet");
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_rows(&path, &[batch(schema, &frames)], None);
    lerobot_meta(folder, solved.len(), FRAMES);
}

fn lerobot_meta(folder: &Path, episodes: usize, frames: u32) {
    const TASK: &str = "Push the block";
    let meta = folder.join("meta");
    fs::create_dir_all(meta.join("episodes/chunk-000")).unwrap();
    let info = json!({
        "codebase_version": "v3.0", "robot_type": "so100", "total_episodes": episodes, "fps": 10, "total_tasks": 1,
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet", "features": {},
    });
    fs::write(meta.join("info.json"), info.to_string()).unwrap();
    let fields = |fields: &[(&str, DataType)]| {
        Schema::new(fields.iter().map(|(name, kind)| Field::new(*name, kind.clone(), true)).collect::<Vec<_>>())
    };
    let tasks = fields(&[("task_index", DataType::Int64), ("__index_level_0__", DataType::Utf8)]);
    let task = json!({ "task_index": 0, "__index_level_0__": TASK });
    write_rows(&meta.join("tasks.parquet"), &[batch(tasks, &[task])], None);
    let texts = DataType::new_list(DataType::Utf8, true);
    let numbers = DataType::new_list(DataType::Float64, true);
    let of_episodes = fields(&[
        ("episode_index", DataType::Int64),
        ("tasks", texts),
        ("length", DataType::Int64),
        ("data/chunk_index", DataType::Int64),
        ("data/file_index", DataType::Int64),
        ("stats/action/mean", numbers),
    ]);
    let episode = |episode| {
        json!({ "episode_index": episode, "tasks": [TASK], "length": frames, "data/chunk_index": 0,
                "data/file_index": 0, "stats/action/mean": [0.0, 1.0] })
    };
    let episodes: Vec<Value> = (0..episodes).map(episode).collect();
    write_rows(&meta.join("episodes/chunk-000/file-000.parquet"), &[batch(of_episodes, &episodes)], None);
}

/// JSON rows as columns of these types.
pub fn batch(schema: Schema, rows: &[Value]) -> RecordBatch {
    let mut decoder = ReaderBuilder::new(Arc::new(schema)).build_decoder().unwrap();
    decoder.serialize(rows).unwrap();
    decoder.flush().unwrap().unwrap()
}
