//! Samples of Inspect's logs as their JSON may have them: ids of any spelling, graders, scores, older keys.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use crate::harness::program::{Answer, run};

const DEFINITIONS: &str = "domain = \"tools\"\n[metric.STEPS]\nvalue = \"length()\"\n";

/// Lines of CSV without the header.
fn queried(at: &Path, columns: &str) -> Vec<String> {
    let sql = format!("select {columns} from steps order by seed, run, t");
    let asked = ["query", &sql, "x.parquet", "--definitions", "tools.toml", "--format", "csv"];
    run(at, &asked).done().lines().skip(1).map(str::to_owned).collect()
}

fn import(at: &Path, file: &str, more: &[&str]) -> Answer {
    fs::write(at.join("tools.toml"), DEFINITIONS).unwrap();
    run(at, &[&["import", file, "-o", "x.parquet", "--definitions", "tools.toml"], more].concat())
}

fn model(more: &Value) -> Value {
    let usage = json!({ "input_tokens": 100, "output_tokens": 10, "total_cost": 0.001 });
    merged(json!({ "event": "model", "output": { "choices": [{ "stop_reason": "stop" }], "usage": usage } }), more)
}

fn tool(more: &Value) -> Value {
    merged(json!({ "event": "tool", "function": "look", "arguments": { "a": 1 } }), more)
}

fn span(event: &str, more: &Value) -> Value {
    merged(json!({ "event": event }), more)
}

fn merged(mut value: Value, more: &Value) -> Value {
    for (key, more) in more.as_object().unwrap() {
        value[key] = more.clone();
    }
    value
}

fn sample(id: &Value, events: &[Value], more: &Value) -> Value {
    merged(json!({ "id": id, "epoch": 1, "scores": { "s": { "value": "C" } }, "events": events }), more)
}

fn header(ids: &[Value]) -> Value {
    let eval = json!({ "eval_id": "e", "task": "t", "model": "m", "dataset": { "sample_ids": ids } });
    json!({ "version": 2, "status": "success", "eval": eval })
}

/// Writes a `.json` log with these samples.
fn json_log(path: &Path, samples: &[Value]) {
    let ids: Vec<Value> = samples.iter().map(|sample| sample["id"].clone()).collect();
    fs::write(path, merged(header(&ids), &json!({ "samples": samples })).to_string()).unwrap();
}

/// Writes a `.eval` log with these members, of samples with these ids.
fn archive(path: &Path, ids: &[Value], members: &[(String, Value)]) {
    let mut zip = zip::ZipWriter::new(fs::File::create(path).unwrap());
    let header = ("header.json".to_owned(), header(ids));
    for (name, value) in members.iter().chain([&header]) {
        zip.start_file(name.as_str(), zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(value.to_string().as_bytes()).unwrap();
    }
    zip.finish().unwrap();
}

/// The member of a sample, as Inspect names it.
fn member(sample: Value) -> (String, Value) {
    let id = sample["id"].as_str().map_or_else(|| sample["id"].to_string(), str::to_owned);
    (format!("samples/{id}_epoch_{}.json", sample["epoch"]), sample)
}

#[test]
fn ids_of_any_spelling_are_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let long = "x".repeat(900);
    let texts =
        ["HumanEval/0", "HumanEval/1", "a/../b", "/c", "d/", "é/ü", "a%2Fb", "a\\b", "x_epoch_2", "y.json", &long];
    let ids: Vec<Value> = texts.iter().map(|id| json!(id)).chain([json!(7), json!(-1), json!("sample.json")]).collect();
    let samples: Vec<Value> = ids.iter().map(|id| sample(id, &[model(&json!({}))], &json!({}))).collect();
    json_log(&at.join("log.json"), &samples);
    import(at, "log.json", &[]).done();
    let expected = queried(at, "seed, run, scene, t, kind");
    assert_eq!(expected.len(), ids.len());
    archive(&at.join("log.eval"), &ids, &samples.iter().cloned().map(member).collect::<Vec<_>>());
    let answer = import(at, "log.eval", &[]).ends(0);
    assert!(answer.stdout.starts_with("imported 14 episodes, 14 steps"), "{}", answer.stdout);
    assert!(!answer.stderr.contains("members"), "{}", answer.stderr);
    assert_eq!(queried(at, "seed, run, scene, t, kind"), expected);
}

/// The members of a sample in chunks of one event.
fn chunks(id: &str, events: &[Value]) -> Vec<(String, Value)> {
    let folder = format!("samples/{id}_epoch_1");
    let mut shell = sample(&json!(id), &[], &json!({}));
    shell.as_object_mut().unwrap().remove("events");
    let part = |name: &str, value: Value| (format!("{folder}/{name}"), value);
    let mut members = vec![
        part("sample.json", shell),
        part("metadata.json", json!({ "note": id })),
        part("skeleton.json", json!({})),
        part("events/stats.json", json!([])),
        part("events/uuids.json", json!([])),
    ];
    members.extend(events.iter().enumerate().map(|(at, event)| part(&format!("events/{at}.json"), json!([event]))));
    members
}

#[test]
fn chunks_are_of_the_sample_that_their_folder_names() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let events = [model(&json!({})), tool(&json!({})), model(&json!({}))];
    // The second lies in the folder of the first, and the third is whole in it.
    let ids = ["a/b", "a/b_epoch_1/c", "a/b_epoch_1/events/0"];
    let mut members = [chunks(ids[0], &events), chunks(ids[1], &events[..1])].concat();
    members.push(member(sample(&json!(ids[2]), &events[..2], &json!({}))));
    let numbers = ids.map(Value::from);
    archive(&at.join("log.eval"), &numbers, &members);
    let answer = import(at, "log.eval", &["--map", "note=sample.metadata.note"]).ends(0);
    assert!(answer.stdout.starts_with("imported 3 episodes, 6 steps"), "{}", answer.stdout);
    assert!(!answer.stderr.contains("members"), "{}", answer.stderr);
    let rows = queried(at, "scene, note, t");
    assert_eq!((&*rows[0], &*rows[3]), ("a/b,a/b,1", "a/b_epoch_1/c,a/b_epoch_1/c,1"));
    members.retain(|(name, _)| name != "samples/a/b_epoch_1/events/1.json");
    archive(&at.join("log.eval"), &numbers, &members);
    let told = import(at, "log.eval", &[]).refused();
    assert!(told.contains("no chunk `samples/a/b_epoch_1/events/1.json`"), "{told}");
}

#[test]
fn unknown_members_are_named_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let one = member(sample(&json!(1), &[model(&json!({}))], &json!({})));
    let stray = |name: &str| (name.to_owned(), json!([1]));
    let known = ["summaries.json", "reductions.json", "_journal/start.json", "_journal/summaries/1.json"].map(stray);
    archive(&at.join("log.eval"), &[json!(1)], &[vec![one.clone()], known.to_vec()].concat());
    assert_eq!(import(at, "log.eval", &[]).ends(0).stderr.matches("members").count(), 0);
    archive(&at.join("log.eval"), &[json!(1)], &[one.clone(), stray("samples/2_epoch_1.txt"), stray("other/x.json")]);
    let told = import(at, "log.eval", &[]).ends(0).stderr;
    assert!(told.contains("left out: 2 members that are no samples, the first `other/x.json`"), "{told}");
    for name in ["samples/2_epoch_1.json", "samples/b_epoch_1/events/0.json"] {
        archive(&at.join("log.eval"), &[json!(1)], &[one.clone(), stray(name)]);
        let told = import(at, "log.eval", &[]).refused();
        assert!(told.contains(name) && told.contains("expected JSON of Inspect"), "{told}");
    }
}

#[test]
fn what_scorers_do_is_no_step_of_the_agent() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let begin = |id: &str, kind: &str, parent: Option<&str>| {
        span("span_begin", &json!({ "id": id, "type": kind, "name": "x", "parent_id": parent, "span_id": id }))
    };
    let end = |id: &str| span("span_end", &json!({ "id": id }));
    let inside = |id: &str| json!({ "span_id": id });
    let step = |action: &str, kind: &str| span("step", &json!({ "action": action, "type": kind, "name": kind }));
    let agent = || vec![model(&json!({})), tool(&json!({})), model(&inside("agent"))];
    let with = |more: Vec<Value>| [agent(), more].concat();
    let samples = [
        // As in today's logs: a scorer in the span of all; its tool has a span of its own.
        with(vec![
            begin("all", "scorers", None),
            begin("one", "scorer", Some("all")),
            begin("inner", "tool", Some("one")),
            model(&inside("inner")),
            tool(&inside("one")),
            end("inner"),
            end("one"),
            end("all"),
        ]),
        // Without ids of spans, the events between the ends; one scorer is never ended.
        with(vec![begin("one", "scorer", None), model(&json!({})), begin("inner", "x", None), tool(&json!({}))]),
        // Before spans there were steps.
        with(vec![
            step("begin", "scorer"),
            step("begin", "x"),
            model(&json!({})),
            step("end", "x"),
            step("end", "scorer"),
        ]),
        // A grader that a solver asks; another role is the agent's.
        with(vec![model(&json!({ "role": "grader" }))]),
        // Concurrent spans: the agent's event names its span.
        vec![
            begin("agent", "agent", None),
            begin("one", "scorer", None),
            model(&inside("agent")),
            model(&inside("one")),
            tool(&merged(inside("one"), &json!({ "events": [model(&json!({}))] }))),
            tool(&inside("agent")),
            end("one"),
            model(&json!({ "role": "critic" })),
        ],
    ];
    let samples: Vec<Value> =
        samples.iter().zip(1..).map(|(events, id)| sample(&json!(id), events, &json!({}))).collect();
    json_log(&at.join("log.json"), &samples);
    let answer = import(at, "log.json", &[]).ends(0);
    assert!(answer.stdout.starts_with("imported 5 episodes, 15 steps"), "{}", answer.stdout);
    assert!(answer.stderr.contains("left out: 6 events of kind model of scorers"), "{}", answer.stderr);
    assert!(answer.stderr.contains("left out: 3 events of kind tool of scorers"), "{}", answer.stderr);
    let costs = queried(at, "seed, sum(cost_micro_usd) over (partition by seed)");
    assert!(costs.iter().all(|row| row.ends_with(",2000")), "{costs:?}");
}

#[test]
fn scores_are_the_numbers_that_inspect_counts() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scores = [
        json!({ "s": { "value": "yes" } }),
        json!({ "s": { "value": "No" } }),
        json!({ "s": { "value": "C" } }),
        json!({ "s": { "value": " 1_0e-1 " } }),
        json!({ "s": { "value": [1, 0] } }),
        json!({ "s": { "value": null }, "other": { "value": 1 } }),
        json!({ "s": { "value": "INFINITE" }, "other": { "value": "TRUE" } }),
        json!({ "s": { "value": { "a": 0.5, "b": "False" } }, "s_b": { "value": 1 } }),
        json!({ "other": { "value": 1 } }),
    ];
    let samples: Vec<Value> =
        scores.iter().zip(1..).map(|(scores, id)| sample(&json!(id), &[], &json!({ "scores": scores }))).collect();
    json_log(&at.join("log.json"), &samples);
    let text = fs::read_to_string(at.join("log.json")).unwrap();
    let header = r#""eval_id":"e","scorers":[{"name":"inspect_ai/s"},{"name":"other"}]"#;
    fs::write(at.join("log.json"), text.replace("\"INFINITE\"", "-Infinity").replace("\"eval_id\":\"e\"", header))
        .unwrap();
    let told = import(at, "log.json", &[]).ends(0).stderr;
    assert!(told.contains("left out: 2 scores without a number, of `s`"), "{told}");
    assert!(told.contains("left out: 1 scores of a second scorer for the column `score_s_b`"), "{told}");
    let expected =
        ["1.0,1.0,,", "0.0,0.0,,", "1.0,1.0,,", "1.0,1.0,,", ",,,", ",,1.0,", ",,1.0,", "0.5,,,0.0", ",,1.0,"];
    assert_eq!(queried(at, "score, score_s, score_other, score_s_b"), expected);
}

#[test]
fn samples_and_attempts_that_are_no_episodes_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let retries = json!([{ "events": [model(&json!({})), tool(&json!({}))] }, { "message": "x" }]);
    let one = sample(&json!(1), &[model(&json!({}))], &json!({ "error_retries": retries }));
    let log = |status: &str, ids: &[Value]| {
        let mut log = merged(header(ids), &json!({ "status": status, "samples": [one] }));
        log["eval"]["config"] = json!({ "epochs": 2 });
        fs::write(at.join("log.json"), log.to_string()).unwrap();
        import(at, "log.json", &[]).ends(0)
    };
    let told = log("error", &[json!("a"), json!(1), json!("b")]);
    let absent = "left out: 5 samples that the log lists and lacks, the first \"a\" in epoch 1; its status is `error`";
    assert!(told.stderr.contains(absent), "{}", told.stderr);
    assert!(told.stderr.contains("left out: 2 events of attempts that failed"), "{}", told.stderr);
    assert!(told.stdout.starts_with("imported 1 episode, 1 step"), "{}", told.stdout);
    let told = log("cancelled", &[]).stderr;
    assert!(told.contains("end of a log, whose status is `cancelled`: samples may be missing"), "{told}");
    json_log(&at.join("log.json"), &[one]);
    let told = import(at, "log.json", &[]).ends(0).stderr;
    assert!(!told.contains("lacks") && !told.contains("status"), "{told}");
    archive(&at.join("log.eval"), &[json!(1), json!(2)], &[member(sample(&json!(1), &[], &json!({})))]);
    let told = import(at, "log.eval", &[]).ends(0).stderr;
    assert!(told.contains("left out: 1 samples that the log lists and lacks, the first 2 in epoch 1"), "{told}");
}

#[test]
fn counts_and_shapes_are_taken_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let import_one = |more: &Value, event: &Value| {
        json_log(&at.join("log.json"), &[sample(&json!(1), &[model(event)], more)]);
        import(at, "log.json", &[])
    };
    let usage = |usage: Value| json!({ "output": { "usage": usage } });
    import_one(&json!({}), &usage(json!({ "input_tokens": 100.0, "output_tokens": 0, "total_cost": 2.5e-6 }))).done();
    assert_eq!(queried(at, "prompt_tokens, completion_tokens, cost_micro_usd"), ["100,0,3"]);
    let none = || json!({});
    for (more, event, expected, found) in [
        (none(), usage(json!({ "output_tokens": -5 })), "a whole number from 0 to", "-5"),
        (none(), usage(json!({ "input_tokens": 1.5 })), "a whole number from 0 to", "1.5"),
        (none(), usage(json!({ "input_tokens": "9" })), "a whole number from 0 to", "the text `9`"),
        (
            none(),
            usage(json!({ "total_cost": 1e300 })),
            "a number from 0 to 9007199254.740992 as `total_cost`",
            "1e300",
        ),
        (none(), json!({ "working_time": -1 }), "a number from 0 to", "-1"),
        (none(), usage(json!([1])), "an object as the `usage`", "a list"),
        (none(), json!({ "output": [1] }), "an object as the `output`", "a list"),
        (json!({ "scores": [1] }), none(), "an object as the `scores`", "a list"),
        (json!({ "scores": { "s": 1 } }), none(), "an object with `value`", "1"),
        (json!({ "events": {} }), none(), "a list as `events`", "an object"),
    ] {
        let told = import_one(&more, &event).refused();
        assert!(told.contains(&format!("log.json, sample 1\n  expected {expected}")), "{told}");
        assert!(told.contains(&format!("found {found}\n")), "{told}");
    }
}

#[test]
fn keys_of_older_logs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let long = tool(&json!({ "arguments": { "a": "tc://k" } }));
    let transcript = json!({ "events": [model(&json!({})), long], "content": { "k": "long" } });
    let old = json!({ "id": 1, "epoch": 1, "score": { "value": "C" }, "transcript": transcript });
    json_log(&at.join("log.json"), &[old]);
    import(at, "log.json", &[]).done();
    assert_eq!(queried(at, "t, kind, arguments, score"), ["1,model,,1.0", "2,tool,\"{\"\"a\"\":\"\"long\"\"}\",1.0"]);
}

#[test]
fn attachments_of_pooled_messages_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let pool = json!([{ "content": "first" }, { "content": "attachment://k" }, { "content": "last" }]);
    let event = |refs: Value| model(&json!({ "input": [], "input_refs": refs }));
    let events = [event(json!([[0, 2]])), event(json!([[2, 3], [0, 2]])), event(json!([[1, 9]]))];
    let more = json!({ "attachments": { "k": "a long text" }, "events_data": { "messages": pool } });
    json_log(&at.join("log.json"), &[sample(&json!(1), &events, &more)]);
    let mapped = ["--map", "first=event.input.0.content", "--map", "second=event.input.1.content"];
    import(at, "log.json", &mapped).done();
    assert_eq!(queried(at, "first, second"), ["first,a long text", "last,first", ","]);
}
