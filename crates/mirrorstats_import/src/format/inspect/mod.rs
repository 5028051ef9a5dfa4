//! Logs of Inspect: one row per model or tool event of the agent, or one row for a sample without such events.
//!
//! A `.eval` log is an archive; a `.json` log is one object. Scalars of `eval`, `sample` and `event` without a column
//! are available to `--map`.

mod archive;
mod references;
mod scores;
mod spans;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead as _, BufReader};

use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::error::ImportError;
use crate::json::from_reader;
use crate::rows::{Rows, Scope};
use crate::value::Cell;
use mirrorstats_exact::budget::{Budget, Limit};

use references::Copies;
use spans::Spans;

const ARCHIVE: &[u8; 4] = b"PK\x03\x04";

const fn most_rows(bytes: u64) -> Limit {
    Limit::new("bytes of rows of a log of its size, 64 more for each value", 128 << 20).and_beyond(1 << 20, 1024, bytes)
}

pub(super) fn read(mut reader: BufReader<File>, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    let failed = ImportError::read(&rows.file);
    let start =
        reader.get_ref().metadata().and_then(|about| Ok((about.len(), reader.fill_buf()?.starts_with(ARCHIVE))));
    let (bytes, is_archive) = start.map_err(failed)?;
    rows.budget = Budget::new(most_rows(bytes));
    if is_archive { archive::read(reader.into_inner(), rows) } else { read_json(reader, rows) }
}

/// Reads the `.json` log of Inspect, which is one object.
fn read_json(json: BufReader<File>, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    #[derive(Deserialize)]
    struct JsonLog {
        #[serde(default)]
        status: Value,
        eval: Value,
        #[serde(default)]
        samples: Option<Vec<Map<String, Value>>>,
    }
    let help = "copy the log again, or export it with `inspect log convert --to eval`";
    let JsonLog { status, eval, samples } = from_reader(json, true).map_err(|error| {
        rows.fault("", "a log of Inspect, an object with `eval` and `samples`", error.to_string(), help)
    })?;
    let mut log = Log::new(eval);
    for (sample, number) in samples.into_iter().flatten().zip(1_u64..) {
        log.add(sample, &format!("sample {number}"), rows)?;
    }
    log.finish(&status, rows);
    Ok(())
}

struct Log {
    eval: Value,
    /// The added epochs of each sample, by its id as JSON, in the order of the data set.
    samples: IndexMap<String, BTreeSet<i64>>,
    /// The number of samples in the data set, which are the first.
    listed: usize,
    epochs: i64,
    later_scorers: Vec<String>,
}

const HELP: &str = "correct the log, or copy it again";
/// The status of a log whose samples are all there.
const COMPLETE: &str = "success";

impl Log {
    fn new(mut eval: Value) -> Self {
        let ids = eval["dataset"].as_object_mut().and_then(|dataset| dataset.remove("sample_ids")).unwrap_or_default();
        let ids = ids.as_array().into_iter().flatten();
        let samples: IndexMap<_, _> = ids.map(|id| (id.to_string(), BTreeSet::new())).collect();
        let epochs = eval["config"]["epochs"].as_i64().unwrap_or(1);
        let scorers = eval["scorers"].as_array().into_iter().flatten().filter_map(|scorer| scorer["name"].as_str());
        let mut scorers = scorers.map(|name| name.rsplit('/').next().unwrap_or(name).to_owned());
        let first = scorers.next();
        let later_scorers = scorers.filter(|name| Some(name) != first.as_ref()).collect();
        Self { listed: samples.len(), samples, epochs, later_scorers, eval }
    }

    /// Counts the listed samples that the log lacks, whose status is null in a log without an end.
    fn finish(&self, status: &Value, rows: &mut Rows<'_>) {
        let status = status.as_str().unwrap_or("none");
        let listed = || self.samples.iter().take(self.listed);
        let added: u64 = listed().map(|(_, added)| added.range(1..=self.epochs.max(1)).count() as u64).sum();
        let absent = (self.listed as u64).saturating_mul(self.epochs.unsigned_abs()).saturating_sub(added);
        let first = listed().find_map(|(id, added)| {
            let epoch = (1..=self.epochs).find(|epoch| !added.contains(epoch))?;
            Some((id, epoch))
        });
        if let Some((id, epoch)) = first {
            let what = format!(
                "samples that the log lists and lacks, the first {id} in epoch {epoch}; its status is `{status}`"
            );
            rows.notes.count(what, absent);
        } else if status != COMPLETE {
            rows.notes.count(format!("end of a log, whose status is `{status}`: samples may be missing"), 1);
        }
    }

    /// Adds the rows of a sample; `part` is its name in the file.
    fn add(&mut self, mut sample: Map<String, Value>, part: &str, rows: &mut Rows<'_>) -> Result<(), ImportError> {
        rename_deprecated(&mut sample);
        let mut take = |key: &str| sample.remove(key).unwrap_or_default();
        let (attachments, pools, events) = (take("attachments"), take("events_data"), take("events"));
        let mut sample = Value::Object(sample);
        shape(&sample["scores"], Value::is_object, "an object as the `scores` of the sample", part, rows)?;
        for retry in sample["error_retries"].as_array().into_iter().flatten() {
            let events = retry["events"].as_array().map_or(0, Vec::len) as u64;
            rows.notes.count("events of attempts that failed and were made again".to_owned(), events);
        }
        let mut constants = self.constants(&mut sample, &mut Copies::new(&attachments, part, rows))?;
        constants.append(&mut scores::columns(&sample["scores"], &self.later_scorers, part, rows)?);
        let mut steps = Vec::new();
        flatten(events, &mut Spans::default(), part, rows, &mut steps)?;
        if steps.is_empty() {
            steps.push(Value::Null);
        }
        for (mut event, t) in steps.into_iter().zip(1_u64..) {
            let columns = step(&mut event, t, &pools, &mut Copies::new(&attachments, part, rows))?;
            let columns = constants.iter().map(|(key, value)| (key.clone(), value.clone())).chain(columns).collect();
            let scopes = [("eval", &self.eval), ("sample", &sample), ("event", &event), ("", &Value::Object(columns))];
            rows.add(&scopes.map(|(name, value)| Scope::new(name, value)))?;
        }
        Ok(())
    }

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
        let added = self.samples.entry(id.to_string());
        let number = added.index() + 1;
        added.or_default().insert(epoch);
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
fn flatten(
    events: Value,
    spans: &mut Spans,
    part: &str,
    rows: &mut Rows<'_>,
    steps: &mut Vec<Value>,
) -> Result<(), ImportError> {
    shape(&events, Value::is_array, "a list as `events`", part, rows)?;
    let Value::Array(events) = events else { return Ok(()) };
    for mut event in events {
        let is_of_scorer = spans.is_of_scorer(&event);
        let kind = event["event"].as_str().unwrap_or_default().to_owned();
        let inner = event.get_mut("events").map(Value::take).unwrap_or_default();
        match kind.as_str() {
            "model" | "tool" if is_of_scorer => {
                rows.notes.count(format!("events of kind {kind} of scorers, which are no steps of the agent"), 1);
            }
            "model" | "tool" => steps.push(event),
            _ => rows.notes.count(format!("events of kind {kind}"), 1),
        }
        flatten(inner, spans, part, rows, steps)?;
    }
    Ok(())
}

/// Refuses a value of another shape; null is that of a log without it.
fn shape(
    value: &Value,
    is: fn(&Value) -> bool,
    expected: &str,
    part: &str,
    rows: &Rows<'_>,
) -> Result<(), ImportError> {
    let fault = || rows.fault(part, expected, Cell::of_json(value).shown(), HELP);
    if value.is_null() || is(value) { Ok(()) } else { Err(fault()) }
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
    let mut columns = event_columns(event, is_tool, t, copies)?;
    columns.values_mut().try_for_each(|value| copies.resolve(value))?;
    Ok(columns)
}

fn event_columns(
    event: &Value,
    is_tool: bool,
    t: u64,
    copies: &Copies<'_, '_>,
) -> Result<Map<String, Value>, ImportError> {
    let output = &event["output"];
    let usage = &output["usage"];
    for (value, is, expected) in [
        (output, Value::is_object as fn(&Value) -> bool, "an object as the `output` of an event"),
        (usage, Value::is_object, "an object as the `usage` of an output"),
        (&output["choices"], Value::is_array, "a list as the `choices` of an output"),
    ] {
        shape(value, is, expected, copies.part, copies.rows)?;
    }
    let count = |holder: &Value, key: &str, factor: f64| count(&holder[key], factor, key, copies);
    let tokens = |keys: &[&str]| {
        let counts = keys.iter().map(|key| count(usage, key, 1.0)).collect::<Result<Vec<_>, _>>();
        counts.map(|counts| counts.into_iter().flatten().reduce(u64::saturating_add))
    };
    let working = count(event, "working_time", 1e3)?;
    let latency = if working.is_some() { working } else { count(output, "time", 1e3)? };
    let choice = &output["choices"][0];
    let called = choice["message"]["tool_calls"].as_array().into_iter().flatten();
    let called: Vec<_> = called.filter_map(|call| call["function"].as_str()).collect();
    let arguments = (is_tool && !event["arguments"].is_null()).then(|| event["arguments"].to_string());
    let error = if is_tool { &event["error"]["message"] } else { &event["error"] };
    Ok(columns([
        ("t", json!(t)),
        ("kind", scalar(&event["event"])),
        ("tool", if is_tool { scalar(&event["function"]) } else { Value::Null }),
        ("arguments", arguments.into()),
        ("choice", json!((!called.is_empty()).then(|| called.join(",")))),
        ("stop_reason", scalar(&choice["stop_reason"])),
        ("error", scalar(error)),
        ("latency_ms", json!(latency)),
        ("prompt_tokens", json!(tokens(&["input_tokens", "input_tokens_cache_read", "input_tokens_cache_write"])?)),
        ("completion_tokens", json!(tokens(&["output_tokens"])?)),
        ("cost_usd", scalar(&usage["total_cost"])),
        ("cost_micro_usd", json!(count(usage, "total_cost", 1e6)?)),
    ]))
}

fn columns<const N: usize>(columns: [(&str, Value); N]) -> Map<String, Value> {
    columns.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// A number from 0 in parts of its unit; without parts it must be whole.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is whole, from 0 to 2^53")]
fn count(value: &Value, parts: f64, key: &str, copies: &Copies<'_, '_>) -> Result<Option<u64>, ImportError> {
    const EXACT: f64 = 9_007_199_254_740_992.0;
    if value.is_null() {
        return Ok(None);
    }
    let counted = value.as_f64().map(|number| number * parts).filter(|parts| (0.0..=EXACT).contains(parts));
    let is_whole = |number: &f64| parts > 1.0 || number.fract() == 0.0;
    let what = if parts > 1.0 { "a number" } else { "a whole number" };
    let fault = || {
        let expected = format!("{what} from 0 to {} as `{key}` of an event", EXACT / parts);
        copies.rows.fault(copies.part, &expected, Cell::of_json(value).shown(), HELP)
    };
    counted.filter(is_whole).map(|number| Some(number.round() as u64)).ok_or_else(fault)
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The value itself; null if it is nested.
fn scalar(value: &Value) -> Value {
    if value.is_array() || value.is_object() { Value::Null } else { value.clone() }
}
