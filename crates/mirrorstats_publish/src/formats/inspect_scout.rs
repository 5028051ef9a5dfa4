//! Transcripts of Inspect Scout: one row per episode, with its messages and its scores.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, BooleanArray, Int64Array, LargeStringArray, RecordBatch};
use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_study::Study;
use parquet::arrow::ArrowWriter;
use serde_json::{Map, Value, json};

use super::{Transcript, transcripts};
use crate::PublishError;

const FILE: &str = "transcripts.parquet";
const LEFT_OUT: [&str; 5] = [
    "frames: messages could hold images, but a row with them is too large to scan",
    "intervals, tests and findings of the design audit: a row is one episode",
    "the steps that decided a metric",
    "definitions, experiments and worlds",
    "the time of an episode: traces have no clock time",
];

pub(super) fn write_all(study: &Study, out: &Path) -> Result<Vec<String>, PublishError> {
    let episodes = study.score()?.episodes;
    let transcripts = transcripts(study, &episodes)?;
    let mut rows = Vec::new();
    for (key, row) in episodes.keys.iter().zip(0..) {
        let Some(transcript) = transcripts.get(key.episode_id) else { continue };
        let mut score = Map::new();
        let mut success = None;
        for column in &episodes.metrics {
            let value = column.get(row);
            if let Some(decimal) = episodes.decimal(column, row) {
                score.insert(column.name.clone(), serde_json::to_value(decimal).unwrap_or_default());
            }
            let is_rate = episodes.catalog.metric[&column.name].kind == Kind::Rate;
            // The first rate is the one that tables begin with.
            success = success.or(value.filter(|_| is_rate).map(|value| value == 1));
        }
        rows.push((key.to_owned(), Value::Object(score).to_string(), success, transcript));
    }
    let text = |of: &dyn Fn(usize) -> Option<String>| -> ArrayRef {
        Arc::new((0..rows.len()).map(of).collect::<LargeStringArray>())
    };
    let number = |of: &dyn Fn(usize) -> i64| -> ArrayRef { Arc::new((0..rows.len()).map(of).collect::<Int64Array>()) };
    let head = |row: usize| &rows[row].3.head;
    let columns: Vec<(&str, ArrayRef)> = vec![
        ("transcript_id", text(&|row| Some(rows[row].0.episode_id.clone()))),
        ("source_type", text(&|_| Some("mirrorstats".to_owned()))),
        ("task_set", text(&|row| Some(rows[row].0.experiment.clone()))),
        (
            "task_id",
            text(&|row| {
                head(row).scene.clone().or_else(|| Some(format!("s{}/r{}", rows[row].0.seed, rows[row].0.run)))
            }),
        ),
        ("task_repeat", number(&|row| head(row).repetition.unwrap_or(1).into())),
        ("model", text(&|row| Some(rows[row].0.model.clone()))),
        ("score", text(&|row| Some(rows[row].1.clone()))),
        ("success", Arc::new(rows.iter().map(|row| row.2).collect::<BooleanArray>())),
        ("message_count", number(&|row| i64::try_from(rows[row].3.said.len() + 1).unwrap_or(i64::MAX))),
        ("messages", text(&|row| Some(messages(&rows[row].0.experiment, rows[row].3).to_string()))),
        ("seed", number(&|row| rows[row].0.seed.into())),
        ("run", number(&|row| rows[row].0.run.into())),
        ("condition", text(&|row| head(row).condition.clone())),
    ];
    let path = out.join(FILE);
    let failed = |error: String| PublishError::Refused(format!("{FILE}: {error}"));
    let batch =
        RecordBatch::try_from_iter_with_nullable(columns.into_iter().map(|(name, values)| (name, values, true)));
    let batch = batch.map_err(|error| failed(error.to_string()))?;
    let file = File::create(&path).map_err(PublishError::file(&path))?;
    let written = ArrowWriter::try_new(file, batch.schema(), None).and_then(|mut writer| {
        writer.write(&batch)?;
        writer.close()
    });
    written.map_err(|error| failed(error.to_string()))?;
    Ok(LEFT_OUT.map(str::to_owned).to_vec())
}

fn messages(experiment: &str, transcript: &Transcript) -> Value {
    transcript
        .messages(experiment, |at, role, content| json!({ "id": at.to_string(), "role": role, "content": content }))
        .into()
}
