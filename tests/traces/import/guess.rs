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

/// The draft of a log scores it as it is, with these values of the first metric in the order of the rows.
fn draft_scores(file: &str, log: &str, metric: &str, values: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join(file), log).unwrap();
    let (text, said) = draft(at, file);
    let scores = run(at, &["score", file, "--definitions", "draft.toml", "--metrics", metric]).done();
    let mut rows = csv::Reader::from_reader(scores.as_bytes());
    let column = rows.headers().unwrap().iter().position(|name| name == metric).unwrap();
    let mut found: Vec<String> = rows.records().map(|row| row.unwrap()[column].to_owned()).collect();
    let mut values: Vec<String> = values.iter().map(|value| (*value).to_owned()).collect();
    found.sort();
    values.sort();
    assert_eq!(found, values, "{file}: {text}");
    said
}

#[test]
fn rows_without_any_id_are_episodes() {
    draft_scores("plain.csv", "reward,steps\n1.5,3\n2.5,4\n", "REWARD", &["1.5", "2.5"]);
    let lines = "{\"doc_id\": 0, \"resps\": [[\"42\"]], \"exact_match\": 0.0}\n{\"doc_id\": 1, \"resps\": [[\"7\"]], \"exact_match\": 1.0}\n";
    draft_scores("samples.jsonl", lines, "EXACT_MATCH", &["0", "1"]);
}

/// Stable-Baselines3's `Monitor`: settings before the header, and times under the name of our steps.
#[test]
fn settings_before_a_header_are_left_out_by_name() {
    let log = "#{\"t_start\": 1700000000.1, \"env_id\": \"CartPole-v1\"}\nr,l,t\n9.25,10,0.5\n11.75,12,1.5\n";
    draft_scores("monitor.csv", log, "R", &["9.25", "11.75"]);
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("monitor.csv"), log).unwrap();
    draft(at, "monitor.csv");
    let answer =
        run(at, &["import", "monitor.csv", "--from", "draft.toml", "--definitions", "draft.toml", "-o", "m.parquet"]);
    assert!(answer.stderr.contains("of settings before the header"), "{}", answer.stderr);
    answer.done();
    fs::write(at.join("monitor.csv"), format!("{log}1\n")).unwrap();
    let error = run(at, &["import", "monitor.csv", "--from", "draft.toml", "-o", "n.parquet"]).refused();
    assert!(error.contains("monitor.csv, line 5"), "{error}");
}

#[test]
fn a_column_that_tells_rows_apart_is_the_model() {
    let log = "arm,task,trial,success,note\nA,peg,1,yes,\nA,peg,2,no,\nB,peg,1,no,\nB,peg,2,no,\n";
    let said = draft_scores("trials.csv", log, "SUCCESS", &["1", "0", "0", "0"]);
    assert!(said.contains("`model` is `arm`, with 2 values") && said.contains("tells apart rows"), "{said}");
}

#[test]
fn a_table_that_lists_its_names_beside_its_rows_is_read() {
    let log = r#"{"columns": ["policy", "trial", "success"], "data": [["pi0", 0, true], ["pi0", 1, false], ["act", 0, true]]}"#;
    let indented = serde_json::to_string_pretty(&serde_json::from_str::<serde_json::Value>(log).unwrap()).unwrap();
    for log in [log, &indented] {
        draft_scores("wandb.table.json", log, "SUCCESS", &["1", "0", "1"]);
    }
}

#[test]
fn a_folder_with_a_file_per_episode_is_drafted_by_its_first_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("results")).unwrap();
    for (number, success) in [(1, 1.0), (2, 0.0)] {
        let log = format!("{{\n  \"task_success\": {success:.1},\n  \"num_steps\": {number}\n}}\n");
        fs::write(at.join(format!("results/episode_{number}_res.json")), log).unwrap();
    }
    let (_, said) = draft(at, "results");
    assert!(said.contains("episode_1_res.json, the first of 2 files"), "{said}");
    let table = run(at, &["report", "results", "--definitions", "draft.toml", "--no-figures", "--out", "o"]).done();
    assert!(table.contains("1/2"), "{table}");
}

#[test]
fn an_object_of_lists_is_refused_with_what_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("stats.json"), r#"{"lift": {"Return": [0.5, 1.0], "Horizon": [9, 12]}}"#).unwrap();
    let error = run(at, &["import", "--guess", "stats.json"]).refused();
    assert!(error.contains("an object of lists, such as `lift.Return`"), "{error}");
}
