//! Lost episodes and data quality: counted separately, bounded, and reported with every table.

use std::fs;
use std::path::Path;

use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};
use serde_json::{Value, json};

use crate::harness::program::run;
use crate::harness::traces::{episode, write_trace};

fn step(action: Option<Action>, status: &str, cube: &str) -> Step {
    let extra = Extra {
        reply_status: Some(status.to_owned()),
        reply_repair: (status == "repaired").then(|| "fence+case".to_owned()),
        latency_ms: Some(100),
        prompt_tokens: Some(1000),
        completion_tokens: Some(50),
        cost_usd: Some(0.001),
        ..Extra::default()
    };
    Step { action, selected_cube: action.map(|_| cube.to_owned()), extra, ..Step::default() }
}

/// Eight episodes: two succeed, four fail, and two end by a timeout.
fn eight() -> Vec<Episode> {
    let turn = || step(Some(Action::TurnLeft), "ok", "none");
    let done = |cube| step(Some(Action::Done), "repaired", cube);
    let cut = || step(None, "timeout", "none");
    let last = [done("red"), done("red"), done("blue"), done("blue"), done("blue"), done("blue"), cut(), cut()];
    let whole = |(run, last): (i32, Step)| Episode { run, ..episode(&format!("e{run}"), vec![turn(), turn(), last]) };
    (1..).zip(last).map(whole).collect()
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let episodes = eight();
    write_trace(&folder.path().join("a.parquet"), &episodes, OptionalColumns::used_by(&episodes));
    folder
}

/// n and sum of the TSA cell.
fn tsa(folder: &Path, arguments: &[&str]) -> (u64, u64) {
    run(folder, &[&["report", "--out", "out", "--no-figures"], arguments].concat()).done();
    let cells = fs::read_to_string(folder.join("out/cells.csv")).unwrap();
    let line = cells.lines().find(|line| line.starts_with("E1,m,TSA,")).unwrap().to_owned();
    let fields: Vec<&str> = line.split(',').collect();
    (fields[3].parse().unwrap(), fields[4].parse().unwrap())
}

#[test]
fn a_headline_and_the_losses_count_the_same_episodes() {
    let folder = folder();
    let at = folder.path();
    assert_eq!(tsa(at, &["a.parquet"]), (6, 2));
    fs::copy(at.join("out/episodes.parquet"), at.join("episodes.parquet")).unwrap();
    assert_eq!(tsa(at, &["episodes.parquet"]), (6, 2));
    assert_eq!(tsa(at, &["a.parquet", "--lost", "as-failure"]), (8, 2));
    let stats: Value = run(at, &["stats", "a.parquet", "--json"]).json();
    let loss = &stats["losses"]["rows"][0];
    assert_eq!([&loss["n"], &loss["successes"], &loss["lost"]], [&json!(6), &json!(2), &json!(2)]);
    let cell = stats["cells"].as_array().unwrap().iter().find(|cell| cell["metric"] == "TSA").unwrap();
    assert_eq!([&cell["n"], &cell["sum"]], [&json!(6), &json!(2)]);
    let notes = run(at, &["report", "a.parquet", "--out", "out"]).ends(0).stderr;
    assert!(notes.contains("2 episodes were lost without an answer: in no denominator"), "{notes}");
    // A file of scores keeps every row and marks the lost ones.
    for name in ["scores.parquet", "scores.csv", "scores.jsonl"] {
        run(at, &["score", "a.parquet", "-o", name]).done();
        assert_eq!(tsa(at, &[name]), (6, 2), "{name}");
        assert_eq!(tsa(at, &[name, "--lost", "as-failure"]), (8, 2), "{name}");
    }
}

#[test]
fn unrecorded_episodes_are_reported_and_can_count_as_failures() {
    let folder = folder();
    let at = folder.path();
    let line = |id: &str, run: u32, model: &str| {
        let reason = json!({ "step": 3, "status": "timeout", "reason": "x" });
        let mut line = json!({ "episode_id": id, "model": model, "experiment": "E1", "seed": 1, "run": run });
        line.as_object_mut().unwrap().extend(reason.as_object().unwrap().clone());
        format!("{line}\n")
    };
    // One of them is in the trace by now, and one is of a model that is not in the traces.
    let lines = [line("e9", 9, "m"), line("e10", 10, "m"), line("e1", 1, "m"), line("o", 1, "other")];
    fs::write(at.join("lost.jsonl"), lines.concat()).unwrap();
    assert_eq!(tsa(at, &["a.parquet"]), (6, 2));
    assert_eq!(tsa(at, &["a.parquet", "--lost", "as-failure"]), (10, 2));
    let stats: Value = run(at, &["stats", "a.parquet", "--json"]).json();
    assert_eq!(stats["losses"]["rows"][0]["lost"], 4);
    let quality = fs::read_to_string(at.join("out/tables/quality.csv")).unwrap();
    assert!(quality.lines().nth(1).unwrap().starts_with("E1,m,8,4,24,24,16,6,"), "{quality}");
    fs::write(at.join("lost.jsonl"), "{\"model\": 7}\n").unwrap();
    let message = run(at, &["report", "a.parquet", "--out", "out"]).refused();
    assert!(message.contains("lost.jsonl, line 1: expected a lost episode"), "{message}");
}

#[test]
fn quality_is_in_reports_in_info_and_in_check() {
    let folder = folder();
    let at = folder.path();
    run(at, &["report", "a.parquet", "--out", "out"]).done();
    let table = fs::read_to_string(at.join("out/tables/quality.md")).unwrap();
    assert!(table.contains("| E1 | m | 8 | 2 | 24 | 2/24 (8.3 %) | timeout 2 | 6: case 6, fence 6 |"), "{table}");
    assert!(fs::read_to_string(at.join("out/report.html")).unwrap().contains("<section id=\"quality\">"));
    assert!(at.join("out/tables/quality.tex").is_file());
    let info: Value = run(at, &["trace", "info", "a.parquet", "--json"]).json();
    let cell = &info["quality"][0];
    assert_eq!(
        [&cell["lost"], &cell["statuses"]["timeout"], &cell["repairs"]["fence"]],
        [&json!(2), &json!(2), &json!(6)]
    );
    assert_eq!(cell["cost_nano_usd"]["sum"], json!(24_000_000));
    assert!(run(at, &["trace", "info", "a.parquet"]).done().contains("timeout 2"));
    run(at, &["trace", "check", "a.parquet", "--max-unreadable", "0.1", "--max-lost", "2"]).done();
    let failed =
        run(at, &["trace", "check", "a.parquet", "--max-unreadable", "0.05", "--max-lost", "0"]).ends(1).stdout;
    assert!(failed.contains("E1, m: --max-unreadable: expected at most 0.05, found 0.0833"), "{failed}");
    assert!(failed.contains("--max-lost: expected at most 0, found 2"), "{failed}");
    let answer: Value = serde_json::from_str(
        &run(at, &["trace", "check", "a.parquet", "--max-unreadable", "0.05", "--json"]).ends(1).stdout,
    )
    .unwrap();
    let violation = json!({
        "cell": { "experiment": "E1", "model": "m", "condition": "default" },
        "limit": "max-unreadable", "expected": 0.05, "found": 2.0 / 24.0,
    });
    assert_eq!(answer["violations"], json!([violation]));
    assert_eq!([&answer["holds"], &answer["not_recorded"]], [&json!(false), &json!([])]);
    assert!(answer.get("passed").is_none());
    assert!(run(at, &["trace", "check", "a.parquet"]).refused().contains("expected a limit to check"));
    assert_eq!(run(at, &["trace", "check", "a.parquet", "--max-unreadable", "5"]).code, 2);
}

#[test]
fn unrecorded_quality_passes_no_check_and_is_not_zero() {
    let folder = tempfile::tempdir().unwrap();
    let episodes = [episode("e1", vec![Step { action: Some(Action::Done), ..Step::default() }])];
    write_trace(&folder.path().join("a.parquet"), &episodes, OptionalColumns::NONE);
    let failed = run(folder.path(), &["trace", "check", "a.parquet", "--max-unreadable", "1"]).ends(1).stdout;
    let told = "E1, m: --max-unreadable: not recorded for 1 of 1 steps, so the limit cannot be checked";
    assert!(failed.contains(told), "{failed}");
    let failed = run(folder.path(), &["trace", "check", "a.parquet", "--max-lost", "9"]).ends(1).stdout;
    assert!(failed.contains("--max-lost: not recorded"), "{failed}");
    run(folder.path(), &["report", "a.parquet", "--out", "out"]).done();
    let quality = fs::read_to_string(folder.path().join("out/tables/quality.md")).unwrap();
    assert!(quality.contains("| E1 | m | 1 | -- | 1 | -- | -- | -- | -- | -- | -- |"), "{quality}");
}

#[test]
fn a_limit_on_replies_that_are_recorded_in_part_is_not_satisfied() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let known = [episode("e1", vec![step(Some(Action::Done), "ok", "red")])];
    write_trace(&at.join("a.parquet"), &known, OptionalColumns::used_by(&known));
    let unknown = [episode("e2", vec![Step { action: Some(Action::Done), ..Step::default() }])];
    write_trace(&at.join("b.parquet"), &unknown, OptionalColumns::NONE);
    let limits = ["--max-unreadable", "1", "--max-lost", "0"];
    let answer = |files: &[&str]| run(at, &[&["trace", "check"], files, &limits].concat());
    answer(&["a.parquet"]).done();
    let failed = answer(&["a.parquet", "b.parquet"]).ends(1).stdout;
    for (limit, missing) in [("max-unreadable", 1), ("max-lost", 2)] {
        assert!(failed.contains(&format!("--{limit}: not recorded for {missing} of 2 steps")), "{failed}");
    }
    let json: Value = serde_json::from_str(&answer(&["a.parquet", "b.parquet", "--json"]).ends(1).stdout).unwrap();
    assert_eq!([&json["holds"], &json["violations"]], [&json!(false), &json!([])]);
    let cell = json!({ "experiment": "E1", "model": "m", "condition": "default" });
    assert_eq!(json["not_recorded"][0], json!({ "cell": cell, "limit": "max-unreadable", "missing": 1, "steps": 2 }));
}

#[test]
fn an_experiment_that_the_definitions_describe_otherwise_is_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.parquet");
    let experiment = json!({ "name": "E1", "title": "Other", "chance": { "TSA": "1/4" } });
    let recording = Some(json!({ "experiment": experiment }));
    let metadata = TraceMetadata { recording, columns: OptionalColumns::NONE };
    let mut writer = TraceWriter::create(&path, &metadata).unwrap();
    writer.write(&episode("e1", vec![Step { action: Some(Action::Done), ..Step::default() }])).unwrap();
    writer.commit().unwrap();
    let told = run(folder.path(), &["trace", "validate", "a.parquet"]).done();
    assert!(told.contains("the chance level of TSA of `E1` as the definitions give it: 1/3"), "{told}");
    assert!(told.contains("found `Other`") && told.contains("0 errors, 2 notes"), "{told}");
    let findings: Value = run(folder.path(), &["trace", "validate", "a.parquet", "--json"]).json();
    assert_eq!(findings["findings"][0]["code"], "experiment-overridden");
}
