//! The `EvalLog` of inspect-robots, version 1: one row per trial.

use std::fs::File;

use serde_json::{Value, json};

use super::RowSink;
use super::json::PythonJson;
use crate::error::ImportError;

/// Lists with one item per trial of a scene, and the column of each.
const PER_TRIAL: [(&str, &str); 5] = [
    ("operator_judgements", "judgement"),
    ("judgement_sources", "judgement_source"),
    ("operator_notes", "note"),
    ("termination_reasons", "termination"),
    ("trial_metadata", "trial"),
];

pub(super) fn read(file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let help = "name a log of `inspect-robots`; another JSON file has another --from";
    let expected = "an EvalLog of inspect-robots, version 1";
    let log: Value = serde_json::from_reader(PythonJson::new(file))
        .map_err(|error| rows.fault("", expected, error.to_string(), help))?;
    let (eval, scenes) = (&log["eval"], log["samples"].as_array());
    let Some(scenes) = scenes.filter(|_| log["version"] == 1 && eval["policy"].is_string()) else {
        return Err(rows.fault("", expected, format!("version {}", log["version"]), help));
    };
    for (scene, number) in scenes.iter().zip(1_u64..) {
        let trials = scene["epochs"].as_array().map_or(&[][..], Vec::as_slice);
        if trials.is_empty() {
            rows.mapping.count_dropped("scenes without a trial".to_owned());
        }
        for (at, scores) in trials.iter().enumerate() {
            add_trial(eval, scene, (number, at), scores, rows)?;
        }
    }
    Ok(())
}

fn add_trial(
    eval: &Value,
    scene: &Value,
    (number, at): (u64, usize),
    scores: &Value,
    rows: &mut RowSink<'_>,
) -> Result<(), ImportError> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let id = [&eval["policy"], &eval["task"], &eval["created"], &scene["scene_id"]].map(text).join("/");
    let columns = scores.as_object().into_iter().flatten();
    let columns = columns.map(|(name, score)| (format!("score_{name}"), score.clone()));
    let per_trial = PER_TRIAL.map(|(list, column)| (column.to_owned(), scene[list][at].clone()));
    let constants = [
        ("episode_id", json!(format!("{id}/{}", at + 1))),
        ("t", json!(1)),
        ("model", eval["policy"].clone()),
        ("experiment", eval["task"].clone()),
        ("seed", json!(number)),
        ("run", json!(at + 1)),
        ("scene", scene["scene_id"].clone()),
        ("status", scene["status"].clone()),
        ("scene_error", scene["error"].clone()),
        ("instruction", scene["instruction"].clone()),
    ];
    let columns: Vec<_> =
        constants.map(|(name, value)| (name.to_owned(), value)).into_iter().chain(per_trial).chain(columns).collect();
    let columns = columns.iter().map(|(name, value)| (name.as_str(), value));
    let nested = [("eval", eval), ("sample", scene)];
    rows.add(&columns.chain(nested).collect::<Vec<_>>())
}
