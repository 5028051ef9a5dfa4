//! Logs of Inspect: one row per model or tool event of the agent, or one row for a sample without such events.
//!
//! A `.eval` log is an archive; a `.json` log is one object. Scalars of `eval`, `sample` and `event` without a column
//! are available to `--map`.

mod archive;
mod references;
mod scores;
mod spans;

use std::collections::HashMap;

use serde_json::{Map, Value, json};

use super::RowSink;
use crate::import::error::ImportError;

pub(super) use archive::{is_archive, read_archive};
use references::Copies;
use spans::Spans;

pub(super) struct Log {
    eval: Value,
    /// The number of each sample in the data set, from 1, by its id as JSON.
    numbers: HashMap<String, usize>,
    next: usize,
    later_scorers: Vec<String>,
}

impl Log {
    pub(super) fn new(mut eval: Value) -> Self {
        let ids = eval["dataset"].as_object_mut().and_then(|dataset| dataset.remove("sample_ids")).unwrap_or_default();
        let ids = ids.as_array().into_iter().flatten();
        let next = ids.clone().count() + 1;
        let scorers = eval["scorers"].as_array().into_iter().flatten().filter_map(|scorer| scorer["name"].as_str());
        let mut scorers = scorers.map(|name| name.rsplit('/').next().unwrap_or(name).to_owned());
        let first = scorers.next();
        let later_scorers = scorers.filter(|name| Some(name) != first.as_ref()).collect();
        Self { numbers: ids.map(ToString::to_string).zip(1..).collect(), next, later_scorers, eval }
    }

    /// Adds the rows of a sample; `part` is its name in the file.
    pub(super) fn add(
        &mut self,
        mut sample: Map<String, Value>,
        part: &str,
        rows: &mut RowSink<'_>,
    ) -> Result<(), ImportError> {
        rename_deprecated(&mut sample);
        let mut take = |key: &str| sample.remove(key).unwrap_or_default();
        let (attachments, pools, events) = (take("attachments"), take("events_data"), take("events"));
        let mut sample = Value::Object(sample);
        let mut constants = self.constants(&mut sample, &mut Copies::new(&attachments, part, rows))?;
        constants.append(&mut scores::columns(&sample["scores"], &self.later_scorers, rows));
        let mut steps = Vec::new();
        flatten(events, &mut Spans::default(), rows, &mut steps);
        if steps.is_empty() {
            steps.push(Value::Null);
        }
        for (mut event, t) in steps.into_iter().zip(1_u64..) {
            let columns = step(&mut event, t, &pools, &mut Copies::new(&attachments, part, rows))?;
            let derived = constants.iter().chain(&columns).map(|(key, value)| (key.as_str(), value));
            let nested = [("eval", &self.eval), ("sample", &sample), ("event", &event)];
            rows.add(&derived.chain(nested).collect::<Vec<_>>())?;
        }
        Ok(())
    }

    /// The columns that are the same in all rows of a sample.
    fn constants(
        &mut self,
        sample: &mut Value,
        copies: &mut Copies<'_, '_>,
    ) -> Result<Map<String, Value>, ImportError> {
        copies.resolve_mapped(sample, "sample")?;
        let lacks =
            |what| copies.rows.fault(copies.part, what, "none", "check that it is a sample of Inspect, version 2");
        let id = sample.get("id").filter(|id| !id.is_null()).ok_or_else(|| lacks("an `id` of the sample"))?;
        let epoch = sample["epoch"].as_i64().ok_or_else(|| lacks("an `epoch` of the sample"))?;
        let number = *self.numbers.entry(id.to_string()).or_insert_with(|| {
            self.next += 1;
            self.next - 1
        });
        let scene = text(id);
        let made = || format!("{}/{scene}/{epoch}", text(&self.eval["eval_id"]));
        let mut columns = columns([
            ("episode_id", sample["uuid"].as_str().map_or_else(made, str::to_owned).into()),
            ("model", self.eval["model"].clone()),
            ("experiment", self.eval["task"].clone()),
            ("seed", json!(number)),
            ("run", json!(epoch)),
            ("scene", scene.into()),
            ("target", scalar(&sample["target"])),
            ("limit", scalar(&sample["limit"]["type"])),
            ("sample_error", scalar(&sample["error"]["message"])),
        ]);
        columns.values_mut().try_for_each(|value| copies.resolve(value))?;
        Ok(columns)
    }
}

/// Gives the keys of logs before 2025 their names of today.
fn rename_deprecated(sample: &mut Map<String, Value>) {
    if let Some(Value::Object(mut transcript)) = sample.remove("transcript") {
        for (before, now) in [("events", "events"), ("content", "attachments")] {
            sample.insert(now.to_owned(), transcript.remove(before).unwrap_or_default());
        }
    }
    if let Some(score) = sample.get("score") {
        let scores = json!({ "scorer": score });
        sample.insert("scores".to_owned(), scores);
    }
}

/// The agent's events that are steps, in order; those inside a tool's event follow it.
fn flatten(events: Value, spans: &mut Spans, rows: &mut RowSink<'_>, steps: &mut Vec<Value>) {
    let Value::Array(events) = events else { return };
    for mut event in events {
        let is_of_scorer = spans.is_of_scorer(&event);
        let kind = event["event"].as_str().unwrap_or_default().to_owned();
        let inner = event.get_mut("events").map(Value::take).unwrap_or_default();
        match kind.as_str() {
            "model" | "tool" if is_of_scorer => {
                rows.mapping
                    .count_dropped(format!("events of kind {kind} of scorers, which are no steps of the agent"));
            }
            "model" | "tool" => steps.push(event),
            _ => rows.mapping.count_dropped(format!("events of kind {kind}")),
        }
        flatten(inner, spans, rows, steps);
    }
}

fn step(
    event: &mut Value,
    t: u64,
    pools: &Value,
    copies: &mut Copies<'_, '_>,
) -> Result<Map<String, Value>, ImportError> {
    copies.expand(event, pools)?;
    copies.resolve_mapped(event, "event")?;
    let is_tool = event["event"] == "tool";
    if let Some(arguments) = event.get_mut("arguments").filter(|_| is_tool) {
        copies.resolve(arguments)?;
    }
    let mut columns = event_columns(event, is_tool, t);
    columns.values_mut().try_for_each(|value| copies.resolve(value))?;
    Ok(columns)
}

fn event_columns(event: &Value, is_tool: bool, t: u64) -> Map<String, Value> {
    let output = &event["output"];
    let usage = &output["usage"];
    let tokens = |keys: &[&str]| keys.iter().filter_map(|key| usage[key].as_u64()).reduce(u64::saturating_add);
    let choice = &output["choices"][0];
    let called = choice["message"]["tool_calls"].as_array().into_iter().flatten();
    let called: Vec<_> = called.filter_map(|call| call["function"].as_str()).collect();
    let arguments = (is_tool && !event["arguments"].is_null()).then(|| event["arguments"].to_string());
    let error = if is_tool { &event["error"]["message"] } else { &event["error"] };
    columns([
        ("t", json!(t)),
        ("kind", scalar(&event["event"])),
        ("tool", if is_tool { scalar(&event["function"]) } else { Value::Null }),
        ("arguments", arguments.into()),
        ("choice", json!((!called.is_empty()).then(|| called.join(",")))),
        ("stop_reason", scalar(&choice["stop_reason"])),
        ("error", scalar(error)),
        ("latency_ms", json!(integer(event["working_time"].as_f64().or(output["time"].as_f64()), 1e3))),
        ("prompt_tokens", json!(tokens(&["input_tokens", "input_tokens_cache_read", "input_tokens_cache_write"]))),
        ("completion_tokens", json!(tokens(&["output_tokens"]))),
        ("cost_usd", scalar(&usage["total_cost"])),
        ("cost_micro_usd", json!(integer(usage["total_cost"].as_f64(), 1e6))),
    ])
}

fn columns<const N: usize>(columns: [(&str, Value); N]) -> Map<String, Value> {
    columns.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "a saturated number is refused as too large")]
fn integer(value: Option<f64>, factor: f64) -> Option<i64> {
    value.map(|value| (value * factor).round() as i64)
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The value itself; null if it is nested.
fn scalar(value: &Value) -> Value {
    if value.is_array() || value.is_object() { Value::Null } else { value.clone() }
}
