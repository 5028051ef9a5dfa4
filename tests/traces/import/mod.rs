//! `mirrorstats import` at the process boundary: valid input becomes a trace, and nothing else does.

mod beside;
mod formats;
mod guess;
#[cfg(feature = "polars")]
mod inspect;
#[cfg(feature = "polars")]
mod inspect_samples;
mod mappings;
mod palette;
mod refusals;
mod round_trip;
mod tables;

use std::borrow::Borrow;
use std::fs;
use std::path::Path;

use mirrorstats_identification::VERSION;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceFile;
use serde_json::{Value, json};

use crate::harness::program::run_with_input as run;
use crate::harness::traces::{score_values, texts};

/// A step of an episode of E1 with only the required keys.
fn step(episode: &str, t: i64) -> Value {
    json!({
        "episode_id": episode, "model": "mine", "experiment": "E1", "seed": 1, "run": 1, "body_color": "red", "t": t,
        "action": "turn_left", "self_color": null, "selected_cube": "none", "mirror_visible": false,
    })
}

/// A step with other values for some keys.
fn step_with(episode: &str, t: i64, values: impl Borrow<Value>) -> Value {
    let mut step = step(episode, t);
    for (key, value) in values.borrow().as_object().unwrap() {
        step[key] = value.clone();
    }
    step
}

fn lines(steps: &[Value]) -> String {
    steps.iter().flat_map(|step| [step.to_string(), "\n".to_owned()]).collect()
}

/// Imports these lines from standard input; returns the trace and the JSON answer.
fn imported(text: impl Into<Vec<u8>>) -> (Vec<u8>, Value) {
    let folder = tempfile::tempdir().unwrap();
    let answer = run(folder.path(), &["import", "-", "-o", "x.parquet", "--json"], text);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    let checked = run(folder.path(), &["trace", "validate", "x.parquet"], "");
    assert_eq!(checked.code, 0, "{}", checked.stdout);
    (fs::read(folder.path().join("x.parquet")).unwrap(), serde_json::from_str(&answer.stdout).unwrap())
}

/// The scores of a trace or of a folder of traces.
fn scores(folder: &Path, trace: &str) -> Vec<Vec<String>> {
    let answer = run(folder, &["score", trace], "");
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    score_values(&answer.stdout)
}

#[test]
fn steps_become_a_trace_that_scores() {
    let folder = tempfile::tempdir().unwrap();
    let steps = [
        step("a", 1),
        step_with("a", 2, json!({ "mirror_visible": true, "self_color": "red" })),
        step_with("a", 3, json!({ "action": "done", "self_color": "red", "selected_cube": "red" })),
    ];
    fs::write(folder.path().join("steps.jsonl"), lines(&steps)).unwrap();
    let answer = run(folder.path(), &["import", "steps.jsonl", "--out", "runs.parquet"], "");
    assert_eq!((answer.code, answer.stderr.as_str()), (0, ""));
    assert_eq!(answer.stdout, "imported 1 episode, 3 steps into runs.parquet\n");
    let scores = scores(folder.path(), "runs.parquet");
    assert_eq!(scores[1][..8], ["a", "mine", "E1", "1", "1", "1", "3", "1"]);
}

#[test]
fn attributions_are_read_from_texts_where_a_step_has_no_key_for_them() {
    let said = |t: i64, text: Value| {
        let mut step = step_with("a", t, json!({ "identification": text }));
        step.as_object_mut().unwrap().remove("self_color");
        step
    };
    let given = step_with("a", 4, json!({ "identification": "I am red", "self_color": "blue" }));
    let steps = [said(1, json!("I am the crimson robot.")), said(2, json!("not red")), said(3, Value::Null), given];
    let (bytes, _) = imported(lines(&steps));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.parquet");
    fs::write(&path, bytes).unwrap();
    let expected = [Some("red"), Some("unknown"), None, Some("blue")].map(|color| color.map(str::to_owned));
    assert_eq!(texts(&path, "self_color"), expected);
    let recording = TraceFile::open(&Input::new(&path)).unwrap().recording();
    assert_eq!(recording["identification_version"], json!(VERSION));
    // Without a text the key is required.
    let mut neither = step("a", 1);
    neither.as_object_mut().unwrap().remove("self_color");
    let refused = run(folder.path(), &["import", "-", "-o", "y.parquet"], lines(&[neither]));
    assert!(refused.code == 2 && refused.stderr.contains("`self_color`"), "{}", refused.stderr);
}

#[test]
fn the_order_of_the_lines_does_not_matter() {
    let a: Vec<Value> = (1..=5).map(|t| step("a", t)).collect();
    let b: Vec<Value> = (1..=4).map(|t| step_with("b", t, json!({ "run": 2 }))).collect();
    let plain = lines(&a) + &lines(&b);
    let (bytes, _) = imported(plain.clone());
    assert_eq!(imported(plain.clone()).0, bytes, "equal input, other bytes");
    let rows = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("x.parquet"), imported(text).0).unwrap();
        scores(folder.path(), "x.parquet")
    };
    let expected = rows(&plain);
    let mut mixed: Vec<Value> = a.iter().chain(&b).cloned().collect();
    mixed.reverse();
    for other in [
        lines(&mixed),
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\n\n  \n"),
        format!("\u{feff}{plain}"),
        plain.trim_end().to_owned(),
    ] {
        assert_eq!(rows(&other), expected);
    }
}

#[test]
fn an_episode_may_lie_in_several_files() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("late.jsonl"), lines(&[step("a", 3), step("b", 1)])).unwrap();
    fs::write(folder.path().join("early.jsonl"), lines(&[step("a", 2), step("a", 1)])).unwrap();
    let answer =
        run(folder.path(), &["import", "late.jsonl", "-", "early.jsonl", "-o", "x.parquet"], lines(&[step("b", 2)]));
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    assert_eq!(answer.stdout, "imported 2 episodes, 5 steps into x.parquet\n");
    assert_eq!(run(folder.path(), &["trace", "validate", "x.parquet"], "").code, 0);
}

#[test]
fn a_pipe_of_any_kind_is_read() {
    let (from_input, _) = imported(lines(&[step("a", 1)]));
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.jsonl"), lines(&[step("a", 1)])).unwrap();
    assert_eq!(run(folder.path(), &["import", "a.jsonl", "-o", "x.parquet"], "").code, 0);
    assert_eq!(fs::read(folder.path().join("x.parquet")).unwrap(), from_input);
}

#[test]
fn other_keys_become_columns_of_their_own() {
    let steps = [
        step_with(
            "a",
            1,
            json!({ "note": null, "gain": 1, "tries": 3, "warm": true, "never": null, "words": "é\u{0}\"" }),
        ),
        step_with("a", 2, json!({ "note": "x", "gain": 0.5, "warm": false, "tries": -9_007_199_254_740_993_i64 })),
        step("a", 3),
    ];
    let (bytes, answer) = imported(lines(&steps));
    let own = json!([
        { "name": "note", "type": "string" }, { "name": "gain", "type": "float" }, { "name": "tries", "type": "int" },
        { "name": "warm", "type": "bool" }, { "name": "never", "type": null }, { "name": "words", "type": "string" },
    ]);
    // The keys have the order of the lines, which `json!` keeps.
    assert_eq!(answer["own_columns"], own);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("x.parquet"), bytes).unwrap();
    let definitions = r#"
        open = true
        [metric.OWN]
        title = "Own"
        value = "count(warm) + 10 * count(tries = -9007199254740993) + 100 * count(gain > 0.7) + 1000 * count(note = 'x')"
    "#;
    fs::write(folder.path().join("own.toml"), definitions).unwrap();
    let answer = run(folder.path(), &["score", "x.parquet", "--definitions", "own.toml"], "");
    assert!(answer.stdout.contains(",1111,"), "{}{}", answer.stdout, answer.stderr);
}

#[test]
fn every_column_of_the_schema_is_taken_at_its_limits() {
    let folder = tempfile::tempdir().unwrap();
    let limits = json!({
        "seed": i32::MIN, "run": i32::MAX, "distractors": 127, "pose_x": 3, "pose_y": -3.4e38, "cost_usd": 0,
        "frame_time": i64::MIN, "latency_ms": 0, "reply_status": "rate_limited", "reply": "", "stated_color": "blue",
    });
    let text = lines(&[step_with("a", 1, limits)]);
    let (bytes, answer) = imported(text);
    fs::write(folder.path().join("x.parquet"), bytes).unwrap();
    assert_eq!(answer["columns"].as_array().unwrap().len(), 11 + 9);
    assert_eq!(answer["own_columns"], json!([]));
    let rows = scores(folder.path(), "x.parquet");
    assert!(rows.iter().any(|row| row[3..5] == [i32::MIN.to_string(), i32::MAX.to_string()]), "{rows:?}");
}

#[test]
fn many_episodes_fill_several_row_groups_and_none_is_split() {
    let mut text = String::new();
    for episode in 0..1320 {
        for t in 1..=100 {
            let line = r#"{"episode_id":"e@","model":"m","experiment":"E5","seed":1,"run":@,"body_color":"red","t":#,"action":null,"self_color":"red","selected_cube":null,"mirror_visible":true}"#;
            text.push_str(&line.replace('@', &episode.to_string()).replace('#', &t.to_string()));
            text.push('\n');
        }
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("x.parquet"), imported(text).0).unwrap();
    let info: Value =
        serde_json::from_str(&run(folder.path(), &["trace", "info", "x.parquet", "--json"], "").stdout).unwrap();
    let checked = run(folder.path(), &["trace", "validate", "x.parquet"], "").stdout;
    assert!(checked.contains("1320 episodes, 132000 steps checked: 0 errors, 0 notes"), "{checked}");
    assert!(info.to_string().contains("132000"), "{info}");
}
