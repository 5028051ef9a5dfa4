//! `rescore`: the same traces and options with other definitions; the old report stays unchanged.

use std::fs;

use serde_json::json;

use crate::changes::{folder, run, secluded};
use crate::harness::files::{contents, repository};

/// The folder of traces, with a report `old` made with special options.
fn reported() -> tempfile::TempDir {
    let folder = folder();
    let options = ["--definitions", "all.toml", "--by", "model,run", "--where", "run < 3", "--style", "paper"];
    let report = ["report", "a.parquet", "b.parquet", "--no-figures", "--out", "old"];
    run(folder.path(), &[&report[..], &options].concat()).ends(0);
    folder
}

#[test]
fn the_report_is_the_one_that_the_same_options_give() {
    let folder = reported();
    let at = folder.path();
    let before = contents(&at.join("old"));
    let answer = run(at, &["table", "rescore", "old", "--definitions", "late.toml"]).ends(0);
    assert!(answer.stdout.contains("1 of 2 cells moved; 1 flip in 1 episode"), "{}", answer.stdout);
    assert!(answer.stderr.contains("the report is in old-rescored"), "{}", answer.stderr);
    assert_eq!(contents(&at.join("old")), before);
    let options = ["--definitions", "late.toml", "--by", "model,run", "--where", "run < 3", "--style", "paper"];
    let report = ["report", "a.parquet", "b.parquet", "--no-figures", "--out", "fresh"];
    run(at, &[&report[..], &options].concat()).ends(0);
    assert_eq!(contents(&at.join("old-rescored")), contents(&at.join("fresh")));
}

#[test]
fn the_same_definitions_give_the_same_bytes() {
    let folder = reported();
    let at = folder.path();
    let answer = run(at, &["table", "rescore", "old", "--definitions", "all.toml", "--out", "new/er", "--json"]).json();
    assert_eq!(contents(&at.join("new/er")), contents(&at.join("old")));
    assert_eq!((&answer["out"], &answer["episodes"]), (&json!("new/er"), &json!(2)));
    assert_eq!((&answer["changes"]["flips"], &answer["changes"]["cells"]), (&json!([]), &json!([])));
}

#[test]
fn a_report_with_figures_is_made_again_with_figures() {
    let folder = folder();
    let at = folder.path();
    run(at, &["report", "a.parquet", "--out", "old"]).ends(0);
    run(at, &["table", "rescore", "old", "--definitions", "paper"]).ends(0);
    assert_eq!(contents(&at.join("old-rescored")), contents(&at.join("old")));
    assert!(at.join("old-rescored/report.html").is_file());
}

#[test]
fn a_choice_of_metrics_is_kept() {
    let folder = folder();
    let at = folder.path();
    run(at, &["report", "a.parquet", "--no-figures", "--metrics", "MCR,TSA", "--out", "old"]).ends(0);
    let answer = run(at, &["table", "rescore", "old", "--definitions", "extended", "--json"]).json();
    assert_eq!(answer["manifest"]["metrics"], json!(["TSA", "MCR"]));
    let said = run(at, &["table", "rescore", "old", "--definitions", "all.toml"]).refused();
    assert!(said.contains("unknown metric `TSA`"), "{said}");
    run(at, &["table", "rescore", "old", "--definitions", "all.toml", "--metrics", "GAZE"]).ends(0);
}

#[test]
fn traces_are_found_anywhere_by_their_hash() {
    let folder = reported();
    let at = folder.path();
    let elsewhere = secluded();
    let report = at.join("old").display().to_string();
    fs::copy(at.join("late.toml"), elsewhere.path().join("late.toml")).unwrap();
    let arguments = ["table", "rescore", report.as_str(), "--definitions", "late.toml", "--out"];
    run(elsewhere.path(), &[&arguments[..], &["above"]].concat()).ends(0);
    fs::create_dir(at.join("moved")).unwrap();
    for name in ["a.parquet", "b.parquet"] {
        fs::rename(at.join(name), at.join("moved").join(name)).unwrap();
    }
    let said = run(elsewhere.path(), &[&arguments[..], &["lost"]].concat()).refused();
    assert!(said.contains("2 of 2 traces") && said.contains("a.parquet: missing"), "{said}");
    let moved = at.join("moved").display().to_string();
    run(elsewhere.path(), &[&arguments[..], &["found", "--traces", &moved]].concat()).ends(0);
    assert_eq!(contents(&elsewhere.path().join("found")), contents(&elsewhere.path().join("above")));
    assert!(!elsewhere.path().join("lost").exists());
}

#[test]
fn every_changed_trace_is_named_and_nothing_is_written() {
    let folder = reported();
    let at = folder.path();
    fs::copy(at.join("b.parquet"), at.join("a.parquet")).unwrap();
    fs::remove_file(at.join("b.parquet")).unwrap();
    let said = run(at, &["table", "rescore", "old", "--definitions", "late.toml"]).refused();
    assert!(said.contains("a.parquet: changed; expected sha256 ") && said.contains(", found "), "{said}");
    assert!(said.contains("b.parquet: missing"), "{said}");
    assert!(!at.join("old-rescored").exists());
}

#[test]
fn the_old_report_is_never_replaced() {
    let folder = reported();
    for out in ["old", "./old/", "old/../old"] {
        let said =
            run(folder.path(), &["table", "rescore", "old", "--definitions", "late.toml", "--out", out]).refused();
        assert!(said.contains("found the report itself"), "{said}");
    }
}

#[test]
fn a_folder_without_a_report_is_refused() {
    let folder = reported();
    let at = folder.path();
    let said = run(at, &["table", "rescore", ".", "--definitions", "late.toml"]).refused();
    assert!(said.contains("expected a report's folder"), "{said}");
    let manifest = fs::read_to_string(at.join("old/manifest.json")).unwrap();
    for (from, to, expected) in [
        ("\"schema_version\": 2", "\"schema_version\": 99", "newer than 2"),
        ("\"path\": \"a.parquet\"", "\"path\": \"/etc/a.parquet\"", "leads out of its folder"),
        ("\"path\": \"a.parquet\"", "\"path\": \"../a.parquet\"", "leads out of its folder"),
        ("\"inputs\"", "\"sources\"", "missing field `inputs`"),
        ("{", "", "manifest.json"),
    ] {
        assert!(manifest.contains(from));
        fs::write(at.join("old/manifest.json"), manifest.replacen(from, to, 1)).unwrap();
        let said = run(at, &["table", "rescore", "old", "--definitions", "late.toml"]).refused();
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn a_style_that_was_a_file_must_be_named_again() {
    let folder = folder();
    let at = folder.path();
    let style = fs::read_to_string(repository().join("assets/styles/default.toml")).unwrap();
    fs::create_dir(at.join("styles")).unwrap();
    fs::write(at.join("styles/mine.toml"), style).unwrap();
    let report = ["report", "a.parquet", "--no-figures", "--style", "styles/mine.toml", "--out", "old"];
    run(at, &report).ends(0);
    let said = run(at, &["table", "rescore", "old", "--definitions", "extended", "--metrics", "MCR"]).refused();
    assert!(said.contains("the report's style `mine`") && said.contains("--style"), "{said}");
    run(at, &["table", "rescore", "old", "--definitions", "paper", "--style", "styles/mine.toml"]).ends(0);
}
