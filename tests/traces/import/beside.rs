//! Steps in files beside a log, as inspect-robots writes them.

use std::fs;
use std::path::Path;

use arrow::util::display::array_value_to_string;
use serde_json::{Value, json};

use crate::harness::program::{Answer, run};
use crate::harness::traces::{recording, rows};

const DEFINITIONS: &str = "domain = \"arms\"\n[metric.STEPS]\nvalue = \"length()\"\n";
const RUN: &str = "actions/20260101_000000_ab";

/// Writes a log with two scenes of two trials each, whose steps are in files beside it: one, two, three and four steps.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("arms.toml"), DEFINITIONS).unwrap();
    fs::create_dir_all(at.join("logs").join(RUN)).unwrap();
    let name = |scene: usize, epoch: usize| format!("{RUN}/scene-{scene}-e{epoch}.jsonl");
    let sample = |scene: usize| {
        json!({ "scene_id": format!("scene-{scene}"), "status": "success", "instruction": "reach",
                "epochs": [{ "success": 1.0 }, { "success": 0.0 }], "termination_reasons": ["success", "max_steps"],
                "trial_metadata": [{ "actions": name(scene, 0) }, { "actions": name(scene, 1) }] })
    };
    let eval = json!({ "task": "reach", "policy": "act", "created": "2026-01-01", "inspect_robots_version": "0.60.0" });
    let log = json!({ "version": 1, "status": "success", "eval": eval, "samples": [sample(0), sample(1)] });
    fs::write(at.join("logs/log.json"), log.to_string()).unwrap();
    for (trial, steps) in (0..4).zip(1..) {
        let (scene, epoch) = (trial / 2, trial % 2);
        let header = json!({ "kind": "header", "scene_id": format!("scene-{scene}"), "epoch": epoch, "labels": null });
        let step = |t: usize| json!({ "t": t, "action": [0.5, t] });
        let lines: Vec<String> =
            [header].into_iter().chain((0..steps).map(step)).map(|line| line.to_string()).collect();
        fs::write(at.join("logs").join(name(scene, epoch)), lines.join("\n") + "\n").unwrap();
    }
    folder
}

fn import(at: &Path) -> Answer {
    let mapped = ["--map", "dx=action.0", "--map", "dy=action.1"];
    run(at, &[&["import", "logs/log.json", "-o", "x.parquet", "--definitions", "arms.toml"][..], &mapped].concat())
}

/// These columns of each row of the trace, separated by bars.
fn found(at: &Path, columns: &[&str]) -> Vec<String> {
    let table = rows(&at.join("x.parquet"));
    let value = |name: &&str, row| array_value_to_string(table.column_by_name(name).unwrap(), row).unwrap();
    (0..table.num_rows()).map(|row| columns.iter().map(|name| value(name, row)).collect::<Vec<_>>().join("|")).collect()
}

/// Changes the log.
fn change(at: &Path, change: impl FnOnce(&mut Value)) {
    let path = at.join("logs/log.json");
    let mut log = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    change(&mut log);
    fs::write(path, log.to_string()).unwrap();
}

#[test]
fn a_trial_has_a_row_per_step_with_its_own_values() {
    let folder = folder();
    let at = folder.path();
    let answer = import(at).ends(0);
    assert!(answer.stdout.starts_with("imported 4 episodes, 10 steps"), "{}", answer.stdout);
    assert!(answer.stderr.contains("left out: 4 rows whose `kind` is \"header\""), "{}", answer.stderr);
    assert!(!answer.stderr.contains("missing"), "{}", answer.stderr);
    let columns = ["model", "seed", "run", "t", "scene", "score_success", "termination", "dx", "dy"];
    let steps = found(at, &columns);
    assert_eq!(steps[0], "act|1|1|1|scene-0|1.0|success|0.5|0");
    assert_eq!(steps[1..3], ["act|1|2|1|scene-0|0.0|max_steps|0.5|0", "act|1|2|2|scene-0|0.0|max_steps|0.5|1"]);
    assert_eq!(steps[9], "act|2|2|4|scene-1|0.0|max_steps|0.5|3");
    assert_eq!(recording(&at.join("x.parquet"))["sources"].as_array().unwrap().len(), 2, "of the log and its files");
    let scores = run(at, &["score", "logs", "--definitions", "arms.toml"]).done();
    assert_eq!(scores.lines().count(), 5, "a folder of logs has the files beside them only once: {scores}");
}

#[test]
fn a_trial_without_its_file_stays_one_row_and_is_named() {
    let folder = folder();
    let at = folder.path();
    let missing = format!("{RUN}/scene-1-e0.jsonl");
    fs::remove_file(at.join("logs").join(&missing)).unwrap();
    fs::remove_file(at.join("logs").join(format!("{RUN}/scene-1-e1.jsonl"))).unwrap();
    change(at, |log| log["samples"][0]["trial_metadata"][0] = json!({}));
    let answer = import(at).ends(0);
    assert!(answer.stdout.starts_with("imported 4 episodes, 5 steps"), "{}", answer.stdout);
    let told = format!("left out: 2 files of steps that are missing, the first `{missing}`");
    assert!(answer.stderr.contains(&told), "{}", answer.stderr);
    assert_eq!(found(at, &["scene", "run", "t", "dy"])[3..], ["scene-1|1|1|", "scene-1|2|1|"]);
    // A trial that ended before its first step has a file without steps.
    fs::write(at.join("logs").join(missing), "{\"kind\": \"header\"}\n").unwrap();
    assert!(import(at).done().starts_with("imported 4 episodes, 5 steps"));
}

#[test]
fn damage_is_named_by_the_file_and_line_beside_the_log() {
    let folder = folder();
    let at = folder.path();
    let name = format!("logs/{RUN}/scene-1-e1.jsonl");
    let whole = fs::read_to_string(at.join(&name)).unwrap();
    for (text, words) in [
        (whole[..whole.len() - 8].to_owned(), "line 5\n  expected strict JSON"),
        (whole.replacen("\"t\":1,", "\"t\":1.5,", 1), "line 3, key `t`\n  expected an integer"),
        (whole.replacen("\"t\":1,", "\"t\":0,", 1), "line 3, key `t`\n  expected one line for each t"),
        (whole.replacen("{\"t\":1,", "{\"t\":7,\"t\":1,", 1), "line 3, key `t`\n  expected each key once"),
    ] {
        fs::write(at.join(&name), text).unwrap();
        let told = import(at).refused();
        assert!(
            told.starts_with(&format!("error: {name}, {words}")) || told.contains(&format!("\nerror: {name}, {words}")),
            "{told}"
        );
    }
}

#[test]
fn a_log_names_files_below_its_folder_and_each_once() {
    let folder = folder();
    let at = folder.path();
    for path in ["../arms.toml", "/etc/passwd", "actions/../log.json"] {
        change(at, |log| log["samples"][0]["trial_metadata"][1]["actions"] = json!(path));
        let told = import(at).refused();
        assert!(told.contains("logs/log.json, row 2\n  expected a path below the folder of the log"), "{told}");
    }
    change(at, |log| log["samples"][0]["trial_metadata"][1] = log["samples"][0]["trial_metadata"][0].clone());
    let told = import(at).refused();
    assert!(told.contains("expected a file of steps of its own for each row"), "{told}");
}

#[test]
fn a_mapping_of_lines_may_name_files_of_steps() {
    let folder = folder();
    let at = folder.path();
    let mapping = "[import]\nsteps = \"{policy}/{trial}.jsonl\"\n[import.columns]\nepisode_id = \"{policy}/{trial}\"\n\
                   model = \"policy\"\nexperiment = { value = \"reach\" }\nseed = 1\nrun = \"trial\"\nt = \"frame+1\"\n";
    fs::write(at.join("from.toml"), mapping).unwrap();
    fs::create_dir(at.join("act")).unwrap();
    fs::write(at.join("trials.jsonl"), "{\"policy\":\"act\",\"trial\":1,\"won\":true}\n").unwrap();
    fs::write(at.join("act/1.jsonl"), "{\"frame\":0,\"won\":false}\n{\"frame\":1}\n").unwrap();
    let import = ["import", "trials.jsonl", "--from", "from.toml", "-o", "x.parquet", "--definitions", "arms.toml"];
    run(at, &import).done();
    assert_eq!(found(at, &["episode_id", "t", "won"]), ["act/1|1|false", "act/1|2|true"]);
}
