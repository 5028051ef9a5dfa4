//! Mapping files: where rows are, what columns are made of, and in which order steps are.

use std::fs;
use std::path::Path;

use arrow::array::RecordBatch;
use arrow::util::display::array_value_to_string;

use crate::harness::program::{Answer, run};
use crate::harness::traces::rows;

const DEFINITIONS: &str = "domain = \"arms\"\n[metric.N]\nvalue = \"length()\"\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("arms.toml"), DEFINITIONS).unwrap();
    folder
}

/// Imports a file with these contents by a mapping.
fn import(at: &Path, file: &str, contents: &str, mapping: &str) -> Answer {
    fs::write(at.join("from.toml"), mapping).unwrap();
    fs::create_dir_all(at.join(file).parent().unwrap()).unwrap();
    fs::write(at.join(file), contents).unwrap();
    run(at, &["import", file, "--from", "from.toml", "-o", "x.parquet", "--definitions", "arms.toml"])
}

/// These columns of a row of the trace, separated by bars.
fn row(table: &RecordBatch, columns: &[&str], at: usize) -> String {
    let value = |name: &&str| array_value_to_string(table.column_by_name(name).unwrap(), at).unwrap();
    columns.iter().map(value).collect::<Vec<_>>().join("|")
}

#[test]
fn columns_are_texts_of_several_values_constants_words_and_other_units() {
    let folder = folder();
    let at = folder.path();
    let mapping = r#"
        [import.columns]
        episode_id = "{policy}/{task}/{trial}"
        model = "policy"
        experiment = { value = "table" }
        seed = "trial"
        run = 1
        t = 1
        success = { from = "result", words = { yes = true, no = false } }
        time_ds = { from = "time_s", scale = 10, unit = "0.1 s" }
    "#;
    let table = "policy,task,trial,result,time_s\npi0,pick,1,yes,24.4\npi0,pick,2,no,0.29\n";
    import(at, "episodes.csv", table, mapping).done();
    let found = rows(&at.join("x.parquet"));
    let columns = ["episode_id", "model", "experiment", "seed", "run", "t", "success", "time_ds", "task"];
    assert_eq!(row(&found, &columns, 0), "pi0/pick/1|pi0|table|1|1|1|true|244.0|pick");
    assert_eq!(row(&found, &columns, 1), "pi0/pick/2|pi0|table|2|1|1|false|2.9|pick");
}

#[test]
fn steps_are_numbered_by_a_column_or_by_their_order() {
    let folder = folder();
    let at = folder.path();
    let columns = "episode_id = \"id\"\nmodel = \"m.name\"\nexperiment = { value = \"x\" }\nseed = 1\nrun = 1\n";
    let line = |frame: i64| format!("{{\"id\":\"e\",\"m\":{{\"name\":\"act\"}},\"frame\":{frame}}}\n");
    let lines = [30, 10, 20].map(line).concat();
    for (t, frames) in
        [("{ from = \"frame\", start = 1 }", ["1|10", "2|20", "3|30"]), ("{ start = 1 }", ["1|30", "2|10", "3|20"])]
    {
        let mapping = format!("[import.columns]\n{columns}t = {t}\nat = \"frame+0\"\n");
        import(at, "steps.jsonl", &lines, &mapping).done();
        let found = rows(&at.join("x.parquet"));
        assert_eq!([0, 1, 2].map(|at| row(&found, &["t", "at"], at)), frames);
    }
    let mapping = format!("[import.columns]\n{columns}t = {{ from = \"frame\", start = 1 }}\n");
    let told = import(at, "steps.jsonl", &[10, 10].map(line).concat(), &mapping).refused();
    assert!(told.contains("t = 10 again, as in steps.jsonl, line 1"), "{told}");
}

#[test]
fn rows_are_in_lists_of_a_file_whose_path_has_values() {
    let folder = folder();
    let at = folder.path();
    let mapping = r##"
        [import]
        rows = "trials[trial].distances[]"
        path = "{model}/L{level}/result.json"
        skip = { is_copy = true }
        [import.columns]
        episode_id = "{model}/{level}/{trial#}"
        model = "model"
        experiment = "task.name"
        seed = "level"
        run = "trial#+1"
        t = "#+1"
        distance = "."
        speed = "speeds[#]"
    "##;
    let result = r#"{ "task": { "name": "reach" }, "trials": [
        { "distances": [0.5, 1], "speeds": [3, 4] }, { "distances": [9], "is_copy": true }, { "distances": [0.25], "speeds": [] } ] }"#;
    let answer = import(at, "out/gpt/L3/result.json", result, mapping).ends(0);
    assert!(answer.stderr.contains("left out: 1 rows whose `is_copy` is true"), "{}", answer.stderr);
    let found = rows(&at.join("x.parquet"));
    let columns = ["episode_id", "model", "experiment", "seed", "run", "t", "distance", "speed"];
    assert_eq!(row(&found, &columns, 0), "gpt/3/0|gpt|reach|3|1|1|0.5|3");
    assert_eq!(row(&found, &columns, 1), "gpt/3/0|gpt|reach|3|1|2|1.0|4");
    assert_eq!(row(&found, &columns, 2), "gpt/3/2|gpt|reach|3|3|1|0.25|");
}

#[test]
fn trajectories_have_a_row_per_step_of_their_own_context() {
    let folder = folder();
    let at = folder.path();
    let trajectory = r#"{ "schema_version": "ATIF-v1.8", "session_id": "s", "agent": { "name": "a", "model_name": "m" },
        "steps": [ { "step_id": 1, "source": "user", "message": "go" },
                   { "step_id": 2, "source": "agent", "message": "old", "is_copied_context": true, "metrics": { "cost_usd": 9 } },
                   { "step_id": 3, "source": "agent", "message": "ok", "tool_calls": [{ "function_name": "bash" }],
                     "metrics": { "prompt_tokens": 10, "completion_tokens": 2, "cost_usd": 0.01 } } ] }"#;
    fs::write(at.join("trajectory.json"), trajectory).unwrap();
    let set = ["--set", "experiment=x", "--set", "seed=1", "--set", "run=1", "--definitions", "arms.toml"];
    let answer = run(at, &[&["import", "trajectory.json", "-o", "x.parquet"], &set[..]].concat()).ends(0);
    assert!(answer.stderr.contains("left out: 1 rows whose `is_copied_context` is true"), "{}", answer.stderr);
    let found = rows(&at.join("x.parquet"));
    assert_eq!(found.num_rows(), 2);
    let columns = ["episode_id", "model", "t", "kind", "tool", "prompt_tokens", "cost_usd"];
    assert_eq!(row(&found, &columns, 0), "s|m|1|user|||");
    assert_eq!(row(&found, &columns, 1), "s|m|2|agent|bash|10|0.01");
}

#[test]
fn mapping_files_with_faults_are_refused() {
    let folder = folder();
    let at = folder.path();
    for (mapping, words) in [
        ("[import]\nrow = \"steps[]\"\n", "unknown field `row`"),
        ("[import]\nrows = \"steps\"\n", "which is not of the form `steps[]`"),
        ("[import]\nformat = \"xml\"\n", "the unknown format `xml`"),
        ("[import.columns]\nt = { start = 0 }\n", "another `start` than 1"),
        ("[import.columns]\nt = {}\n", "neither `from` nor `value` for the column `t`"),
        ("[import.columns]\nmodel = \"{a\"\n", "a `{` without `}` for the column `model`"),
    ] {
        let told = import(at, "steps.jsonl", "{}\n", mapping).refused();
        assert!(
            told.contains("--from from.toml: expected a format, or a mapping file") && told.contains(words),
            "{told}"
        );
    }
    let told = run(at, &["import", "steps.jsonl", "--from", "xml", "-o", "x.parquet"]).refused();
    assert!(told.contains("--from xml: expected a format, or a mapping file with `[import]`"), "{told}");
}
