//! Every Eval Ever 0.3: per model, one file of results with intervals, and one line per episode and rate.

use std::collections::BTreeMap;
use std::path::Path;

use mirrorstats_exact::hash;
use mirrorstats_metric::catalogs::catalog::{Better, Kind};
use mirrorstats_score::cells::{Cell, KeyValue};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_study::Study;
use serde_json::{Value, json};

use super::{Transcript, transcripts};
use crate::about::About;
use crate::{PublishError, write};

const VERSION: &str = "0.3.0";
const LEFT_OUT: [&str; 5] = [
    "frames: the format has no images",
    "the steps that decided a metric",
    "values of quantities per episode: a line needs `is_correct`, so only rates have lines",
    "paired comparisons, tests and findings of the design audit",
    "definitions, experiments and worlds",
];

pub(super) fn write_all(study: &Study, about: &About, out: &Path) -> Result<Vec<String>, PublishError> {
    let models = results(study)?;
    let episodes = study.score()?.episodes;
    let transcripts = transcripts(study, &episodes)?;
    let unknown = models.keys().find(|model| !model.contains('/')).cloned();
    for (model, results) in models {
        let (developer, own) = model.split_once('/').unwrap_or(("unknown", &model));
        let id = format!("{developer}/{own}");
        let evaluation_id = format!("mirrorstats/{id}/{}", timestamp(about));
        let lines = lines(&model, &id, &evaluation_id, &episodes, &transcripts);
        let uuid = uuid(&format!("{evaluation_id}\n{}\n{lines}", Value::from(results.clone())));
        let path = format!("data/mirrorstats/{}/{}/{uuid}", portable(developer), portable(own));
        let mut root = json!({
            "schema_version": VERSION, "evaluation_id": evaluation_id, "retrieved_timestamp": timestamp(about),
            "source_metadata": {
                "source_name": about.title(), "source_type": "evaluation_run",
                "source_organization_name": about.authors.first().map_or("unknown", String::as_str),
                "evaluator_relationship": "other",
            },
            "eval_library": { "name": "mirrorstats", "version": env!("CARGO_PKG_VERSION") },
            "model_info": {
                "name": model, "id": id,
                "additional_details": { "deployment_type": "unknown", "model_availability": "unknown" },
            },
            "evaluation_results": results,
        });
        if !lines.is_empty() {
            root["detailed_evaluation_results"] = json!({
                "format": "jsonl", "file_path": format!("{path}_samples.jsonl"), "hash_algorithm": "sha256",
                "checksum": hash::of_bytes(lines.as_bytes()), "total_rows": lines.lines().count(),
            });
            write(&out.join(format!("{path}_samples.jsonl")), lines)?;
        }
        let text = serde_json::to_string_pretty(&root).expect("a tree of JSON values") + "\n";
        write(&out.join(format!("{path}.json")), text)?;
    }
    let mut left_out = LEFT_OUT.map(str::to_owned).to_vec();
    if let Some(model) = unknown {
        left_out.push(format!("a model without its developer: name `{model}` as DEVELOPER/MODEL"));
    }
    Ok(left_out)
}

/// The results of each model.
fn results(study: &Study) -> Result<BTreeMap<String, Vec<Value>>, PublishError> {
    let cells = study.cells()?;
    if cells.by != ["experiment", "model"] {
        let found = cells.by.join(",");
        let help =
            "help: a line of the format belongs to one experiment; leave --by out, or keep one condition with --where";
        let message = format!("expected episodes grouped by experiment,model, found {found}\n  {help}");
        return Err(PublishError::Refused(message));
    }
    let mut models: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for cell in cells.all() {
        if let [KeyValue::Text(experiment), KeyValue::Text(model)] = cell.key
            && let Some(result) = result(&cell, experiment)
        {
            models.entry(model.clone()).or_default().push(result);
        }
    }
    Ok(models)
}

/// A cell; `None` without a mean.
fn result(cell: &Cell, experiment: &str) -> Option<Value> {
    let (metric, moments) = (cell.metric, cell.moments);
    let name = format!("{experiment}: {}", cell.name);
    let is_rate = metric.kind == Kind::Rate;
    let range = metric.value_range();
    let bound = |value: Option<i64>, none: &str| value.map_or_else(|| none.into(), Value::from);
    let mut uncertainty = json!({ "num_samples": moments.n });
    if let Some(value) = metric.standard_error(moments) {
        uncertainty["standard_error"] = json!({ "value": value, "method": "analytic" });
    }
    if let Some(interval) = cell.interval {
        let [lower, upper] = [interval.low, interval.high].map(|bound| metric.in_unit(bound));
        let method = if is_rate { "wilson" } else { "student" };
        uncertainty["confidence_interval"] =
            json!({ "lower": lower, "upper": upper, "confidence_level": 0.95, "method": method });
    }
    Some(json!({
        "evaluation_result_id": name, "evaluation_name": name,
        "source_data": { "dataset_name": "mirrorstats", "source_type": "other" },
        "metric_config": {
            "evaluation_description": metric.help, "metric_id": cell.name, "metric_name": metric.title,
            "metric_unit": metric.unit, "lower_is_better": metric.better == Better::Lower, "score_type": "continuous",
            "min_score": if is_rate { 0.into() } else { bound(range.least, "-Infinity") },
            "max_score": if is_rate { 1.into() } else { bound(range.most, "Infinity") },
        },
        "score_details": { "score": metric.mean(moments)?, "uncertainty": uncertainty },
    }))
}

/// One line per episode and rate of a model.
fn lines(
    model: &str,
    id: &str,
    evaluation_id: &str,
    episodes: &EpisodeTable,
    transcripts: &BTreeMap<String, Transcript>,
) -> String {
    let mut lines = String::new();
    for (key, row) in episodes.keys.iter().zip(0..).filter(|(key, _)| key.model == model) {
        let Some(transcript) = transcripts.get(key.episode_id) else { continue };
        let turn = |at, role: &str, content: &str| json!({ "turn_idx": at, "role": role, "content": content });
        let messages = transcript.messages(key.experiment, turn);
        for column in &episodes.metrics {
            let Some(value) = column.get(row).filter(|_| episodes.catalog.metric[&column.name].kind == Kind::Rate)
            else {
                continue;
            };
            let name = format!("{}: {}", key.experiment, column.name);
            let scene = transcript.head.scene.clone().unwrap_or_else(|| format!("seed {}, run {}", key.seed, key.run));
            let line = json!({
                "schema_version": VERSION, "evaluation_id": evaluation_id, "model_id": id, "evaluation_name": name,
                "evaluation_result_id": name, "sample_id": key.episode_id, "interaction_type": "agentic",
                "input": { "raw": messages[0]["content"], "reference": [] }, "messages": messages, "answer_attribution": [],
                "evaluation": { "score": value, "is_correct": value == 1, "num_turns": messages.len() },
                "metadata": { "scene": scene },
            });
            lines.push_str(&line.to_string());
            lines.push('\n');
        }
    }
    lines
}

/// Seconds since 1970 as text: the time that the author states, else 0. No clock is read.
fn timestamp(about: &About) -> String {
    about.time.unwrap_or_default().to_string()
}

/// A name that every file system takes.
fn portable(name: &str) -> String {
    let kept = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    name.chars().map(kept).collect::<String>().trim_end_matches('.').to_owned()
}

/// A UUID of version 4 in form, from a hash, so that equal results have equal names.
fn uuid(text: &str) -> String {
    let hash = hash::of_bytes(text.as_bytes());
    format!("{}-{}-4{}-8{}-{}", &hash[..8], &hash[8..12], &hash[13..16], &hash[17..20], &hash[20..32])
}
