//! Metrics of floats: each output has the numbers in the metric's own unit, and the same ones.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::harness::files::repository;
use crate::run;

/// Two policies in two rooms, six episodes each; the distance at the end is `(run + 10) / 100` m, one more for `far`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut lines = String::new();
    for (model, more) in [("near", 0.0), ("far", 1.0)] {
        for room in ["hall", "yard"] {
            for run in 1..=6 {
                let step = json!({
                    "episode_id": format!("{model}-{room}-{run}"), "model": model, "experiment": room, "seed": 1,
                    "run": run, "t": 1, "success": run < 4, "force": 0.3,
                    "distance": f64::from(run + 10) / 100.0 + more,
                });
                writeln!(lines, "{step}").unwrap();
            }
        }
    }
    fs::write(folder.path().join("steps.jsonl"), lines).unwrap();
    fs::copy(repository().join("examples/domains/navigation.toml"), folder.path().join("nav.toml")).unwrap();
    run(folder.path(), &["import", "steps.jsonl", "-o", "nav.parquet", "--definitions", "nav.toml"]).done();
    folder
}

fn cells(folder: &Path, input: &str) -> String {
    let words = ["report", input, "--no-figures", "--out", "report", "--definitions", "nav.toml"];
    run(folder, &words).done();
    fs::read_to_string(folder.join("report/cells.csv")).unwrap()
}

#[test]
fn scores_of_each_format_give_the_cells_of_the_traces() {
    let folder = folder();
    let at = folder.path();
    let found = cells(at, "nav.parquet");
    // 0.11 + ... + 0.16 m, and 1 m more.
    for row in
        ["hall,near,FINAL,6,0.81,0.1111,", "yard,far,FINAL,6,6.81,7.7311,", "hall,near,FORCE,6,1.800,0.540000,0.3,0,,"]
    {
        assert!(found.contains(row), "no {row} in {found}");
    }
    for name in ["s.csv", "s.jsonl", "s.parquet"] {
        run(at, &["score", "nav.parquet", "-o", name]).done();
        assert_eq!(cells(at, name), found, "{name}");
    }
    let scores = fs::read_to_string(at.join("s.csv")).unwrap();
    assert!(scores.contains("\nnear-hall-1,near,hall,1,1,1,0.11,0.300,0.300,"), "{scores}");
    fs::write(at.join("s.csv"), scores.replace(",0.11,", ",0.115,")).unwrap();
    let told = run(at, &["report", "s.csv", "--definitions", "nav.toml"]).refused();
    assert!(told.contains("`FINAL`") && told.contains("0.115"), "{told}");
}

#[test]
fn statistics_gates_and_evidence_use_the_unit() {
    let folder = folder();
    let at = folder.path();
    let found = run(at, &["stats", "nav.parquet", "--json"]).json();
    let cell = found["cells"].as_array().unwrap().iter().find(|cell| {
        cell["metric"] == "FINAL" && cell["key"]["experiment"] == "hall" && cell["key"]["model"] == "near"
            || cell["metric"] == "FINAL" && cell["experiment"] == "hall" && cell["model"] == "near"
    });
    let cell = cell.unwrap_or_else(|| panic!("{}", found["cells"][0]));
    assert_eq!((&cell["sum"], cell["mean"].as_f64().unwrap()), (&json!(0.81), 0.135));
    let explained = run(at, &["score", "nav.parquet", "--explain", "far-yard-6", "--json"]).json();
    let metrics = explained["metrics"].as_array().unwrap();
    let value = |name: &str| metrics.iter().find(|metric| metric["metric"] == name).unwrap()["value"].clone();
    assert_eq!((value("FINAL"), value("SUCCESS"), value("NEAR")), (json!(1.16), json!(0), json!(0)));
    let lines = fs::read_to_string(at.join("steps.jsonl")).unwrap().replace("\"distance\":0.11", "\"distance\":0.2");
    fs::write(at.join("later.jsonl"), lines).unwrap();
    run(at, &["import", "later.jsonl", "-o", "later.parquet", "--definitions", "nav.toml"]).done();
    let gate = run(at, &["gate", "nav.parquet", "later.parquet", "--metric", "FINAL", "--format", "json"]);
    let gate: Value = serde_json::from_str(&gate.stdout).unwrap();
    let sides = gate["cells"].as_array().unwrap().iter().map(|cell| cell["base"]["mean"].as_f64().unwrap());
    assert_eq!(sides.map(|mean| (mean * 1000.0).round()).collect::<Vec<_>>(), [1135.0, 135.0, 1135.0, 135.0]);
}

#[test]
fn a_number_without_decimals_is_refused_by_name() {
    let folder = folder();
    let at = folder.path();
    let lines = fs::read_to_string(at.join("steps.jsonl")).unwrap().replace("\"distance\":0.11", "\"distance\":1e300");
    fs::write(at.join("steps.jsonl"), lines).unwrap();
    run(at, &["import", "steps.jsonl", "-o", "nav.parquet", "--definitions", "nav.toml"]).done();
    let told = run(at, &["score", "nav.parquet", "-o", "s.csv"]).refused();
    assert!(told.contains("2 decimals") && told.contains("`FINAL` reads the number 1"), "{told}");
    let text = fs::read_to_string(at.join("nav.toml")).unwrap();
    for (from, to, words) in [
        ("decimals = 2\n", "", "`round(x, 3)`"),
        ("decimals = 2\n", "decimals = 12\n", "a number from 0 to 9"),
        ("value = \"any(success)\"", "value = \"at(success, distance)\"", "timestep"),
        ("value = \"max(force)\"", "value = \"max(force)\"\nfinished = \"SUCCESS\"", "has decimals"),
        ("value = \"max(force)\"", "value = \"max(force * force * force * force)\"", "digits after the point"),
    ] {
        fs::write(at.join("bad.toml"), text.replacen(from, to, 1)).unwrap();
        let told = run(at, &["definitions", "check", "bad.toml"]).refused();
        assert!(told.contains(words), "{words}: {told}");
    }
}

#[test]
fn a_table_has_models_by_experiments_or_the_reverse_with_their_mean() {
    let folder = folder();
    let at = folder.path();
    let style = "[print]\ncell = \"mean_se\"\n[table.main]\ntitle = \"Distance\"\ncolumns = [\"FINAL\"]\nmean = true\n";
    for (layout, header, row) in [
        ("models-by-experiments", "| Model | hall | yard | Mean |", "| near | "),
        ("experiments-by-models", "| Experiment | far | near |", "| Mean | "),
    ] {
        fs::write(at.join("mine.toml"), format!("{style}layout = \"{layout}\"\n")).unwrap();
        run(at, &["report", "nav.parquet", "--style", "mine.toml", "--no-figures", "--out", "report"]).done();
        let table = fs::read_to_string(at.join("report/tables/main.md")).unwrap();
        let squeezed = table.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(squeezed.contains(header) && squeezed.contains(row), "{table}");
        assert!(squeezed.contains("Final distance ↓") && table.contains("0.14"), "{table}");
        let latex = fs::read_to_string(at.join("report/tables/main.tex")).unwrap();
        assert!(latex.contains("\\begin{table}[t]") && latex.contains("\\sbox0{%"), "{latex}");
    }
}
