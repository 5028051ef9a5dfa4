//! A cell has the same interval in tables, `cells.csv`, the page, `view`, queries, Arrow and `stats`.
//!
//! Python's `cells` are the Arrow batch.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use mirrorstats_trace::episodes::episode::{Action, Episode, Extra, Step};
use mirrorstats_trace::write::OptionalColumns;
use serde_json::Value;

use crate::harness::program::run;
use crate::harness::traces::{episode, write_trace};

/// Bounds by model and metric; `None` if the interval is withheld.
type Found = BTreeMap<(String, String), Option<(f64, f64)>>;

const DEFINITIONS: &str = r#"
include = ["paper"]
[metric.TURNING]
unit = "ppm"
value = "div(1000000 * count(action = 'turn_left'), length())"
[metric.OFFSET]
unit = "lights"
value = "50 - length()"
[metric.TURNS]
unit = "steps"
value = "count(action = 'turn_left')"
[metric.SHARE]
unit = "permille"
measures = "fraction"
range = { least = 0, most = 1000 }
value = "div(1000 * count(action = 'turn_left'), length())"
[metric.WAIT]
unit = "half steps"
finished = "TSA-C"
value = "2 * length()"
[metric.GAIN]
unit = "lights"
range = { least = -50 }
value = "50 - length()"
"#;

/// Models and the steps of their episodes; 100 without a decision.
fn durations() -> Vec<(&'static str, Vec<usize>)> {
    let [mut low, mut high] = [vec![1; 13], vec![100; 12]];
    low.push(60);
    high.extend([95, 60]);
    let many = (0..40).map(|at| 10 + at * 7 % 80).collect();
    vec![
        ("one", vec![5]),
        ("two", vec![7, 10]),
        ("three", vec![3, 9, 30]),
        ("alike", vec![20; 4]),
        ("alike-many", vec![20; 14]),
        ("low", low),
        ("high", high),
        ("many", many),
    ]
}

fn played(model: &str, run: usize, steps: usize) -> Episode {
    let done = |t| t == steps && steps < 100;
    let step = |t: usize| Step {
        action: Some(if done(t) { Action::Done } else { Action::TurnLeft }),
        selected_cube: done(t).then(|| if run.is_multiple_of(3) { "red" } else { "blue" }.to_owned()),
        ..Step::default()
    };
    let own = episode(&format!("{model}-{run}"), (1..=steps).map(step).collect());
    Episode { model: model.to_owned(), run: i32::try_from(run).unwrap(), ..own }
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let of = |(model, steps): (&'static str, Vec<usize>)| {
        (1..).zip(steps).map(move |(run, steps)| played(model, run, steps)).collect::<Vec<_>>()
    };
    let episodes: Vec<Episode> = durations().into_iter().flat_map(of).collect();
    write_trace(&folder.path().join("a.parquet"), &episodes, OptionalColumns::NONE);
    fs::write(folder.path().join("mine.toml"), DEFINITIONS).unwrap();
    folder
}

fn key(model: &str, metric: &str) -> (String, String) {
    (model.to_owned(), metric.to_owned())
}

fn of_stats(at: &Path) -> Found {
    let stats: Value = run(at, &["stats", "a.parquet", "--definitions", "mine.toml", "--json"]).json();
    let cell = |cell: &Value| {
        let intervals = &cell["intervals"];
        let interval = intervals.get("wilson").or_else(|| intervals.get("student_t")).unwrap();
        let bounds = interval["low"].as_f64().zip(interval["high"].as_f64());
        (key(cell["key"]["model"].as_str().unwrap(), cell["metric"].as_str().unwrap()), bounds)
    };
    stats["cells"].as_array().unwrap().iter().map(cell).collect()
}

/// The cells of a CSV file, by its column names.
fn of_csv(text: &str) -> (Found, Vec<[String; 5]>) {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|column| column == name).unwrap();
    let [model, metric, n, sum, low, high] = ["model", "metric", "n", "sum", "ci_low", "ci_high"].map(at);
    let (mut found, mut texts) = (Found::new(), Vec::new());
    for record in reader.records().map(Result::unwrap) {
        let bounds = record[low].parse().ok().zip(record[high].parse().ok());
        found.insert(key(&record[model], &record[metric]), bounds);
        texts.push([metric, n, sum, low, high].map(|at| record[at].to_owned()));
    }
    texts.sort();
    texts.dedup();
    (found, texts)
}

#[cfg(feature = "polars")]
fn of_query(at: &Path) -> Found {
    let select = "SELECT model, metric, ci_low, ci_high FROM cells";
    let text = run(at, &["query", select, "a.parquet", "--definitions", "mine.toml", "--format", "jsonl"]).done();
    let row = |line: &str| {
        let row: Value = serde_json::from_str(line).unwrap();
        let bounds = row["ci_low"].as_f64().zip(row["ci_high"].as_f64());
        (key(row["model"].as_str().unwrap(), row["metric"].as_str().unwrap()), bounds)
    };
    text.lines().map(row).collect()
}

fn of_arrow(at: &Path) -> Found {
    let study = mirrorstats::Study::open([at.join("a.parquet")]).unwrap().definitions(at.join("mine.toml")).unwrap();
    let batch = mirrorstats::record_batch(&study.cells().unwrap()).unwrap();
    let text = |name: &str, row: usize| batch.column_by_name(name).unwrap().as_string::<i32>().value(row).to_owned();
    let bound = |name: &str, row: usize| {
        let column = batch.column_by_name(name).unwrap().as_primitive::<Float64Type>();
        column.is_valid(row).then(|| column.value(row))
    };
    let row = |row| ((text("model", row), text("metric", row)), bound("ci_low", row).zip(bound("ci_high", row)));
    (0..batch.num_rows()).map(row).collect()
}

/// The cells of the page, from its attributes: metric, n, sum and bounds.
fn of_page(page: &str) -> Vec<[String; 5]> {
    let attribute = |cell: &str, name: &str| {
        let rest = cell.split_once(&format!("{name}=\"")).unwrap().1;
        rest.split_once('"').unwrap().0.to_owned()
    };
    let cells = page.split("<td data-metric").skip(1).map(|cell| format!("<td data-metric{cell}"));
    let names = ["data-metric", "data-n", "data-sum", "data-ci-low", "data-ci-high"];
    let mut found: Vec<[String; 5]> = cells.map(|cell| names.map(|name| attribute(&cell, name))).collect();
    found.sort();
    // A metric may be in two tables.
    found.dedup();
    found
}

/// The cells in an exported copy of `view`.
#[cfg(feature = "view")]
fn of_view(at: &Path) -> Vec<[String; 5]> {
    run(at, &["view", "a.parquet", "--definitions", "mine.toml", "--export", "seen"]).done();
    let script = fs::read_to_string(at.join("seen/data/overview.js")).unwrap();
    let json = script.split_once(", ").unwrap().1.trim_end().trim_end_matches([')', ';']);
    let overview: Value = serde_json::from_str(json).unwrap();
    let sections: Vec<&str> =
        overview["sections"].as_array().unwrap().iter().map(|text| text.as_str().unwrap()).collect();
    of_page(&sections.concat())
}

#[test]
fn every_output_has_the_interval_that_stats_has() {
    let folder = folder();
    let at = folder.path();
    let printed = run(at, &["report", "a.parquet", "--definitions", "mine.toml", "--out", "out"]).done();
    let stats = of_stats(at);
    let (cells, texts) = of_csv(&fs::read_to_string(at.join("out/cells.csv")).unwrap());
    assert_eq!(cells, stats);
    assert_eq!(of_arrow(at), stats);
    #[cfg(feature = "polars")]
    assert_eq!(of_query(at), stats);
    assert_eq!(of_page(&fs::read_to_string(at.join("out/report.html")).unwrap()), texts);
    #[cfg(feature = "view")]
    assert_eq!(of_view(at), texts);
    // Printed tables are rounded; they have bounds exactly where the others do.
    let mut printed_cells = BTreeSet::new();
    for table in ["main", "appendix"] {
        let (rounded, _) = of_csv(&fs::read_to_string(at.join(format!("out/tables/{table}.csv"))).unwrap());
        for (cell, bounds) in rounded {
            assert_eq!(bounds.is_some(), stats[&cell].is_some(), "{cell:?} of {table}");
            printed_cells.insert(cell);
        }
    }
    assert_eq!(printed_cells.len(), stats.len());
    // Withheld intervals, and intervals bounded by a metric's range.
    for metric in ["TTD", "TURNS", "TURNING", "OFFSET"] {
        for model in ["one", "two", "three", "alike", "alike-many"] {
            assert_eq!(stats[&key(model, metric)], None, "{metric} of {model}");
        }
        assert!(stats[&key("many", metric)].is_some(), "{metric}");
    }
    let bounds = |model: &str, metric: &str| stats[&key(model, metric)].unwrap();
    assert_eq!(bounds("low", "TTD").0.to_bits(), 0.0f64.to_bits());
    assert_eq!(bounds("high", "TTD").1.to_bits(), 100.0f64.to_bits());
    assert_eq!(bounds("high", "TURNING").1.to_bits(), 1e6f64.to_bits());
    assert!(bounds("high", "OFFSET").0 < -50.0, "an amount of another kind has no bounds");
    assert_eq!(bounds("high", "GAIN").0.to_bits(), (-50.0f64).to_bits(), "a declared range bounds it");
    assert_eq!(bounds("high", "SHARE").1.to_bits(), 1000.0f64.to_bits());
    assert_eq!(bounds("high", "WAIT").1.to_bits(), 200.0f64.to_bits(), "an own duration has the budget of its unit");
    assert!(stats[&key("one", "TSA")].is_some(), "a rate has an interval from one episode on");
    // The table states the reason.
    let line = |model: &str| printed.lines().find(|line| line.trim_start().starts_with(model)).unwrap();
    assert!(line("two").contains("*8.5*† n=2"), "{printed}");
    assert!(printed.contains("A mean of fewer than 12 episodes has no interval"), "{printed}");
    let paper = run(at, &["report", "a.parquet", "--style", "paper", "--out", "paper"]).done();
    assert!(!paper.contains("no interval"), "{paper}");
}

fn reply(run: i32, status: &str) -> Episode {
    let extra = Extra { reply_status: Some(status.to_owned()), ..Extra::default() };
    let cube = if run % 3 == 0 { "red" } else { "blue" }.to_owned();
    let step = Step { action: Some(Action::Done), selected_cube: Some(cube), extra, ..Step::default() };
    Episode { run, ..episode(&format!("e{run}"), vec![step]) }
}

#[test]
fn unusable_replies_are_in_stats_and_in_the_printed_report() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let episodes: Vec<Episode> = (1..=21).map(|run| reply(run, if run == 1 { "ok" } else { "parse_failed" })).collect();
    write_trace(&at.join("a.parquet"), &episodes, OptionalColumns::used_by(&episodes));
    let words = "20 of 21 replies gave no decision (E1 m 20 of 21)";
    assert!(run(at, &["report", "a.parquet", "--out", "out", "--no-figures"]).done().contains(words));
    assert!(run(at, &["stats", "a.parquet"]).done().contains(words));
    let stats: Value = run(at, &["stats", "a.parquet", "--json"]).json();
    assert_eq!([&stats["replies"]["replies"], &stats["replies"]["unusable"]], [&Value::from(21), &Value::from(20)]);
    assert!(stats["warnings"].as_array().unwrap().iter().any(|it| it.as_str().unwrap().contains(words)), "{stats}");
}

#[test]
fn a_filter_is_named_beside_tables_and_verdicts() {
    let folder = folder();
    let at = folder.path();
    let by_results = ["--where", "TSA = 1"];
    let by_keys = ["--where", "model <> 'one'"];
    let told = "Only episodes where `TSA = 1`; the filter chose them by their results";
    // Without a terminal, text is not wrapped.
    let stats = run(at, &[&["stats", "a.parquet"], &by_results[..]].concat()).done();
    assert!(stats.contains(told) && stats.contains("(episodes chosen by their results: `TSA = 1`)"), "{stats}");
    let json: Value = run(at, &[&["stats", "a.parquet", "--json"], &by_results[..]].concat()).json();
    assert_eq!(json["where"], serde_json::json!({ "condition": "TSA = 1", "by_results": true }));
    for list in ["conclusions", "warnings"] {
        assert!(json[list][0].as_str().unwrap().starts_with(told), "{list}: {json}");
    }
    let sequential = run(at, &[&["stats", "a.parquet", "--sequential"], &by_results[..]].concat()).done();
    assert!(sequential.contains(told), "{sequential}");
    let printed = run(at, &[&["report", "a.parquet", "--out", "out"], &by_results[..]].concat()).done();
    assert!(printed.contains(told), "{printed}");
    for file in ["tables/main.md", "tables/main.tex", "report.html"] {
        let text = fs::read_to_string(at.join("out").join(file)).unwrap();
        assert!(text.contains("Only episodes where"), "{file}");
    }
    let stats = run(at, &[&["stats", "a.parquet"], &by_keys[..]].concat()).done();
    assert!(stats.contains("Only episodes where `model <> 'one'`.") && !stats.contains("by their results"), "{stats}");
    let json: Value = run(at, &["stats", "a.parquet", "--json"]).json();
    assert_eq!(json["where"], Value::Null);
}
