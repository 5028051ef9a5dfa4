//! `import --guess` drafts one file that `import` and every command on traces take, and logs are read where traces are.

use std::fs;
use std::path::Path;

use crate::harness::program::run;

/// One row per episode, as spreadsheets have them.
const EPISODES: &str = "policy,task,trial,success,time_s,interventions\npi0,pick,1,1,24.4,1\npi0,pick,2,1,53.8,0\n\
                        act,pick,1,0,5.4,3\nact,pick,2,yes,9.1,2\n";

/// Steps in lines of nested objects, in any order.
fn navigation() -> String {
    let line = |run: usize, step: usize| {
        let (near, done) = (["3.0", "2.5", "2.0", "1.5"][step], step == 3 && run != 2);
        format!(
            r#"{{"run_id": "r{run}", "policy": {{"name": "p{}"}}, "task": {{"name": "kitchen", "seed": {}}}, "step": {step}, "obs": {{"pose": [0.1]}}, "info": {{"collision": {}, "dist_to_goal": {near}, "success": {done}}}, "say": "on"}}"#,
            run % 2,
            run / 2 + 1,
            step == 1,
        )
    };
    let lines = (0..4).flat_map(|run| (0..4).rev().map(move |step| line(run, step)));
    lines.collect::<Vec<_>>().join("\n")
}

/// Writes the draft of a file beside it; returns the draft and what it rests on.
fn draft(at: &Path, file: &str) -> (String, String) {
    let answer = run(at, &["import", "--guess", file]);
    let said = answer.stderr.clone();
    let text = answer.done();
    fs::write(at.join("draft.toml"), &text).unwrap();
    (text, said)
}

#[test]
fn a_draft_of_nested_lines_scores_them_without_another_word() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("nav.jsonl"), navigation()).unwrap();
    let (text, said) = draft(at, "nav.jsonl");
    insta::assert_snapshot!(format!("{text}\n{said}"));

    let scores = run(at, &["score", "nav.jsonl", "--definitions", "draft.toml"]).done();
    run(at, &["import", "nav.jsonl", "--from", "draft.toml", "--definitions", "draft.toml", "-o", "x.parquet"]).done();
    assert_eq!(scores, run(at, &["score", "x.parquet"]).done());
    assert_eq!(scores.lines().filter(|line| line.starts_with('r')).count(), 4);
}

#[test]
fn a_draft_of_a_spreadsheet_has_an_id_of_several_columns() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("episodes.csv"), EPISODES.replace("yes", "1")).unwrap();
    let (text, said) = draft(at, "episodes.csv");
    insta::assert_snapshot!(format!("{text}\n{said}"));

    let table = run(at, &["report", "episodes.csv", "--definitions", "draft.toml", "--no-figures"]).done();
    assert!(table.contains("pi0") && table.contains("act"), "{table}");
    let verdict = run(at, &["stats", "episodes.csv", "--definitions", "draft.toml"]).done();
    assert!(verdict.contains("SUCCESS"), "{verdict}");
}

#[test]
fn words_for_success_become_truth_values_and_other_words_do_not() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("words.csv"), "model,task,run,outcome\na,x,1,pass\na,x,2,FAIL\n").unwrap();
    let (text, _) = draft(at, "words.csv");
    assert!(text.contains(r#"outcome = { from = "outcome", words = { "pass" = true, "FAIL" = false } }"#), "{text}");
    fs::write(at.join("others.csv"), "model,task,run,outcome\na,x,1,pass\na,x,2,perhaps\n").unwrap();
    let (text, said) = draft(at, "others.csv");
    assert!(!text.contains("outcome") && said.contains("add the metric that decides"), "{text}{said}");
}

#[test]
fn columns_with_one_name_get_different_ones() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let line = r#"{"model": "a", "task": "x", "run": 1, "a": {"force": 1}, "force": 2, "b": {"force": 3}, "steps": 4}"#;
    fs::write(at.join("twice.jsonl"), line).unwrap();
    let (text, _) = draft(at, "twice.jsonl");
    let scores = run(at, &["score", "twice.jsonl", "--definitions", "draft.toml"]).done();
    assert!(
        ["1", "2", "3", "4"].iter().all(|value| scores.lines().nth(1).unwrap().split(',').any(|cell| cell == *value)),
        "{text}{scores}"
    );
}

#[test]
fn rows_in_lists_of_one_object_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let object = r#"{"agent": "a", "tasks": [{"task": "x", "episodes": [{"seed": 1, "solved": true}, {"seed": 2, "solved": false}]},
        {"task": "y", "episodes": [{"seed": 1, "solved": false}]}]}"#;
    fs::write(at.join("all.json"), object).unwrap();
    let (text, _) = draft(at, "all.json");
    assert!(text.contains("rows = \"tasks[].episodes[]\"") && text.contains("\"{agent}/{task}/{seed}\""), "{text}");
    let scores = run(at, &["score", "all.json", "--definitions", "draft.toml"]).done();
    assert_eq!(scores.lines().count(), 4, "{scores}");
}

#[test]
fn a_gate_reads_logs_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("old.csv"), EPISODES.replace("yes", "1")).unwrap();
    fs::create_dir(at.join("new")).unwrap();
    fs::write(at.join("new/a.csv"), EPISODES.replace("yes", "0")).unwrap();
    draft(at, "old.csv");
    let before: Vec<_> = fs::read_dir(at).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    let gate = run(at, &["gate", "old.csv", "new", "--definitions", "draft.toml", "--format", "json"]);
    assert!(gate.stdout.contains("\"verdict\""), "{}{}", gate.stdout, gate.stderr);
    let after: Vec<_> = fs::read_dir(at).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(before, after);
}

#[test]
fn one_message_says_that_a_log_is_of_another_domain() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("nav.jsonl"), navigation()).unwrap();
    let said = run(at, &["report", "nav.jsonl"]).refused();
    assert!(said.contains("this looks like another domain") && said.contains("import --guess"), "{said}");
    assert!(said.lines().count() < 12, "{said}");
}
