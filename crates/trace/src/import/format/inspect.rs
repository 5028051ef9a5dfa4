//! Logs of Inspect: one row per model or tool event, or one row for a sample without such events.
//!
//! A `.eval` log is an archive with one member per sample, or a folder of chunks; a `.json` log is one object. Scalars
//! of `eval`, `sample` and `event` without a column are available to `--map`.

use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{self, BufReader, Read as _, Seek as _};

use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use zip::{CompressionMethod, ZipArchive};

use super::RowSink;
use super::json::from_slice;
use crate::import::error::ImportError;
use exact::budget::Limit;
use exact::input;

const ARCHIVE: &[u8; 4] = b"PK\x03\x04";
const ATTACHMENT: &str = "attachment://";
/// A sample with all its events.
const LARGEST: Limit = Limit::new("bytes of a member of a log", 2 << 30);

pub(super) fn is_archive(file: &mut File) -> io::Result<bool> {
    let mut start = [0; 4];
    let is_archive = file.read_exact(&mut start).is_ok() && start == *ARCHIVE;
    file.rewind().map(|()| is_archive)
}

pub(super) fn read_archive(file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
    let help = "copy the log again; `inspect log recover` mends one whose writer was ended";
    let expected = "a log of Inspect, an archive with a directory at its end";
    let mut archive = EvalArchive::open(file).map_err(|found| rows.fault("", expected, found, help))?;
    let header = ["header.json", "_journal/start.json"].into_iter().find(|name| archive.names.contains(*name));
    let header = header.ok_or_else(|| rows.fault("", expected, "neither `header.json` nor a journal", help))?;
    let damaged = |rows: &RowSink<'_>, name: &str, found| rows.fault(name, "JSON of Inspect", found, help);
    let head: Value = archive.json(header).map_err(|found| damaged(rows, header, found))?;
    let mut log = Log::new(head["eval"].clone());
    for name in archive.names.clone() {
        let Some(path) = name.strip_prefix("samples/") else { continue };
        let sample = match path.strip_suffix("/sample.json") {
            Some(_) => chunked(&mut archive, name.trim_end_matches("sample.json")),
            None if !path.contains('/') => archive.json(&name),
            None => continue,
        };
        let sample = sample.map_err(|found| damaged(rows, &name, found))?;
        log.add(sample, rows).map_err(|found| found.into_error(rows, &name))?;
    }
    Ok(())
}

/// Members of a zip archive: stored, deflated, or method 93 (zstd with any number of frames). The last of several
/// members with one name counts.
struct EvalArchive {
    zip: ZipArchive<BufReader<File>>,
    names: BTreeSet<String>,
}

impl EvalArchive {
    fn open(file: File) -> Result<Self, String> {
        let zip = ZipArchive::new(BufReader::new(file)).map_err(|error| error.to_string())?;
        let names = zip.file_names().map(str::to_owned).collect();
        Ok(Self { zip, names })
    }

    fn json<T: DeserializeOwned>(&mut self, name: &str) -> Result<T, String> {
        let bytes = self.bytes(name).map_err(|error| error.to_string())?;
        from_slice(&bytes).map_err(|error| error.to_string())
    }

    fn bytes(&mut self, name: &str) -> io::Result<Vec<u8>> {
        let index = self.zip.index_for_name(name).ok_or(io::ErrorKind::NotFound)?;
        let raw = self.zip.by_index_raw(index)?;
        if raw.compression() != CompressionMethod::ZSTD {
            drop(raw);
            return input::bytes_of(self.zip.by_index(index)?, LARGEST);
        }
        let crc = raw.crc32();
        let bytes = input::bytes_of(zstd::Decoder::new(raw)?, LARGEST)?;
        let found = crc32fast::hash(&bytes);
        if found == crc {
            Ok(bytes)
        } else {
            Err(io::Error::other(format!("checksum {found:08x} instead of {crc:08x}")))
        }
    }
}

fn chunked(archive: &mut EvalArchive, folder: &str) -> Result<Map<String, Value>, String> {
    let mut sample: Map<String, Value> = archive.json(&format!("{folder}sample.json"))?;
    let metadata = format!("{folder}metadata.json");
    if archive.names.contains(&metadata) {
        sample.insert("metadata".to_owned(), archive.json(&metadata)?);
    }
    let mut sequence = |name: &str| -> Result<Value, String> {
        let prefix = format!("{folder}{name}/");
        let members = archive.names.range(prefix.clone()..).take_while(|member| member.starts_with(&prefix));
        let start = |member: &String| member[prefix.len()..].strip_suffix(".json")?.parse::<u64>().ok();
        let mut chunks: Vec<_> = members.filter_map(|member| Some((start(member)?, member.clone()))).collect();
        chunks.sort_unstable();
        let items = chunks.iter().map(|(_, member)| archive.json::<Vec<Value>>(member));
        Ok(Value::Array(items.collect::<Result<Vec<_>, _>>()?.concat()))
    };
    let pools = json!({ "messages": sequence("messages")?, "calls": sequence("calls")? });
    for name in ["events", "attachments"] {
        sample.insert(name.to_owned(), sequence(name)?);
    }
    sample.insert("events_data".to_owned(), pools);
    Ok(sample)
}

pub(super) struct Log {
    eval: Value,
    /// The number of each sample in the data set, from 1, by its id as JSON.
    numbers: HashMap<String, usize>,
}

pub(super) enum SampleFault {
    Shape(&'static str),
    Import(ImportError),
}

impl SampleFault {
    pub(super) fn into_error(self, rows: &RowSink<'_>, part: &str) -> ImportError {
        match self {
            Self::Import(error) => error,
            Self::Shape(what) => rows.fault(part, what, "none", "check that it is a sample of Inspect, version 2"),
        }
    }
}

impl Log {
    pub(super) fn new(mut eval: Value) -> Self {
        let ids = eval["dataset"].as_object_mut().and_then(|dataset| dataset.remove("sample_ids")).unwrap_or_default();
        let ids = ids.as_array().into_iter().flatten().map(ToString::to_string).zip(1..);
        Self { eval, numbers: ids.collect() }
    }

    pub(super) fn add(&mut self, mut sample: Map<String, Value>, rows: &mut RowSink<'_>) -> Result<(), SampleFault> {
        let mut take = |key: &str| sample.remove(key).unwrap_or_default();
        let (attachments, pools, events) = (take("attachments"), take("events_data"), take("events"));
        let mut sample = Value::Object(sample);
        resolve(&mut sample, &attachments);
        let id = sample.get("id").filter(|id| !id.is_null()).ok_or(SampleFault::Shape("an `id` of the sample"))?;
        let epoch = sample["epoch"].as_i64().ok_or(SampleFault::Shape("an `epoch` of the sample"))?;
        let next = self.numbers.len() + 1;
        let number = *self.numbers.entry(id.to_string()).or_insert(next);
        let mut constants = self.constants(&sample, id, epoch, number);
        constants.extend(scores(&sample["scores"], rows));
        let mut steps = Vec::new();
        flatten(events, rows, &mut steps);
        if steps.is_empty() {
            steps.push(Value::Null);
        }
        for (mut event, t) in steps.into_iter().zip(1_u64..) {
            resolve(&mut event, &attachments);
            expand(&mut event, &pools, rows);
            let columns = step(&event, t);
            let derived = constants.iter().chain(&columns).map(|(key, value)| (key.as_str(), value));
            let nested = [("eval", &self.eval), ("sample", &sample), ("event", &event)];
            rows.add(&derived.chain(nested).collect::<Vec<_>>()).map_err(SampleFault::Import)?;
        }
        Ok(())
    }

    fn constants(&self, sample: &Value, id: &Value, epoch: i64, number: usize) -> Vec<(String, Value)> {
        let scene = text(id);
        let made = || format!("{}/{scene}/{epoch}", text(&self.eval["eval_id"]));
        let columns = [
            ("episode_id", sample["uuid"].as_str().map_or_else(made, str::to_owned).into()),
            ("model", self.eval["model"].clone()),
            ("experiment", self.eval["task"].clone()),
            ("seed", json!(number)),
            ("run", json!(epoch)),
            ("scene", scene.into()),
            ("target", scalar(&sample["target"])),
            ("limit", scalar(&sample["limit"]["type"])),
            ("sample_error", scalar(&sample["error"]["message"])),
        ];
        columns.map(|(name, value)| (name.to_owned(), value)).into()
    }
}

/// The events that are steps, in order; those inside a tool's event follow it.
fn flatten(events: Value, rows: &mut RowSink<'_>, steps: &mut Vec<Value>) {
    let Value::Array(events) = events else { return };
    for mut event in events {
        let kind = event["event"].as_str().unwrap_or_default().to_owned();
        let inner = event.get_mut("events").map(Value::take).unwrap_or_default();
        if kind == "model" || kind == "tool" {
            steps.push(event);
        } else {
            rows.mapping.count_dropped(format!("events of kind {kind}"));
        }
        flatten(inner, rows, steps);
    }
}

fn step(event: &Value, t: u64) -> Vec<(String, Value)> {
    let (output, is_tool) = (&event["output"], event["event"] == "tool");
    let usage = &output["usage"];
    let tokens = |keys: &[&str]| keys.iter().filter_map(|key| usage[key].as_u64()).reduce(|a, b| a + b);
    let choice = &output["choices"][0];
    let called = choice["message"]["tool_calls"].as_array().into_iter().flatten();
    let called: Vec<_> = called.filter_map(|call| call["function"].as_str()).collect();
    let arguments = (is_tool && !event["arguments"].is_null()).then(|| event["arguments"].to_string());
    let error = if is_tool { &event["error"]["message"] } else { &event["error"] };
    let columns = [
        ("t", json!(t)),
        ("kind", scalar(&event["event"])),
        ("tool", if is_tool { scalar(&event["function"]) } else { Value::Null }),
        ("arguments", json!(arguments)),
        ("choice", json!((!called.is_empty()).then(|| called.join(",")))),
        ("stop_reason", scalar(&choice["stop_reason"])),
        ("error", scalar(error)),
        ("latency_ms", json!(integer(event["working_time"].as_f64().or(output["time"].as_f64()), 1e3))),
        ("prompt_tokens", json!(tokens(&["input_tokens", "input_tokens_cache_read", "input_tokens_cache_write"]))),
        ("completion_tokens", json!(tokens(&["output_tokens"]))),
        ("cost_usd", scalar(&usage["total_cost"])),
        ("cost_micro_usd", json!(integer(usage["total_cost"].as_f64(), 1e6))),
    ];
    columns.map(|(name, value)| (name.to_owned(), value)).into()
}

#[expect(clippy::cast_possible_truncation, reason = "a saturated number is refused as too large")]
fn integer(value: Option<f64>, factor: f64) -> Option<i64> {
    value.map(|value| (value * factor).round() as i64)
}

/// `score` of the first scorer, and a column for each.
fn scores(scores: &Value, rows: &mut RowSink<'_>) -> Vec<(String, Value)> {
    let mut columns = vec![("score".to_owned(), Value::Null)];
    for (name, score) in scores.as_object().into_iter().flatten() {
        let parts: Vec<_> = match &score["value"] {
            Value::Object(parts) => parts.iter().map(|(key, part)| (format!("score_{name}_{key}"), part)).collect(),
            part => vec![(format!("score_{name}"), part)],
        };
        for (column, part) in parts {
            let value = number(part);
            if value.is_none() && !part.is_null() {
                rows.mapping.count_dropped("scores without a number".to_owned());
            }
            if columns[0].1.is_null() {
                columns[0].1 = json!(value);
            }
            columns.push((column, json!(value)));
        }
    }
    columns
}

fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Bool(value) => Some(f64::from(u8::from(*value))),
        Value::String(text) => match text.as_str() {
            "C" => Some(1.0),
            "P" => Some(0.5),
            "I" | "N" => Some(0.0),
            text => text.parse().ok(),
        },
        value => value.as_f64(),
    }
}

fn resolve(value: &mut Value, attachments: &Value) {
    match value {
        Value::String(text) => {
            let Some(key) = text.strip_prefix(ATTACHMENT) else { return };
            let found = match attachments {
                Value::Array(list) => key.parse().ok().and_then(|at: usize| list.get(at)),
                attachments => attachments.get(key),
            };
            if let Some(found) = found {
                *value = found.clone();
            }
        }
        Value::Array(list) => list.iter_mut().for_each(|value| resolve(value, attachments)),
        Value::Object(members) => members.values_mut().for_each(|value| resolve(value, attachments)),
        _ => {}
    }
}

/// Replaces references to the message pools in an event whose messages are mapped.
fn expand(event: &mut Value, pools: &Value, rows: &RowSink<'_>) {
    let of = |refs: &Value, pool: &Value| -> Option<Value> {
        let range =
            |pair: &Value| Some(usize::try_from(pair[0].as_u64()?).ok()?..usize::try_from(pair[1].as_u64()?).ok()?);
        let parts = refs.as_array()?.iter().map(|pair| Some(pool.as_array()?.get(range(pair)?)?.to_vec()));
        Some(Value::Array(parts.collect::<Option<Vec<_>>>()?.concat()))
    };
    if rows.mapping.reads("event.input")
        && let Some(input) = of(&event["input_refs"], &pools["messages"])
    {
        event["input"] = input;
    }
    let key = event["call"]["call_key"].as_str().unwrap_or("messages").to_owned();
    if rows.mapping.reads("event.call")
        && let Some(messages) = of(&event["call"]["call_refs"], &pools["calls"])
        && event["call"]["request"].is_object()
    {
        event["call"]["request"][key] = messages;
    }
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The value itself; null if it is nested.
fn scalar(value: &Value) -> Value {
    if value.is_array() || value.is_object() { Value::Null } else { value.clone() }
}
