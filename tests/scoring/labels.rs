//! Coders' labels as columns: filters, groups, definitions, queries, every engine. Also the agreement of coders.

use std::fmt::Write as _;
use std::path::Path;

use mirrorstats::Study;
use serde_json::{Value, json};

use crate::assert_shown;
use crate::harness::files::fixture;
use crate::harness::program::{Answer, run};

/// A folder with traces of the paper's fixture and their labels; 14 episodes of E1 and one model are coded.
fn coded() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    std::fs::create_dir(&runs).unwrap();
    for name in ["E1-gpt-5-1.parquet", "E2-gpt-5-1.parquet"] {
        std::fs::copy(fixture("paper").join(name), runs.join(name)).unwrap();
    }
    let mut lines = String::new();
    let ids: Vec<String> =
        [1, 2].into_iter().flat_map(|seed| (1..=7).map(move |run| format!("E1/gpt-5-1/s{seed}/r{run}"))).collect();
    for (at, id) in ids.iter().enumerate() {
        for (coder, every) in [("ann", 2), ("bob", 3)] {
            let label = (at % every == 0).then_some("confabulates");
            let step = label.map(|_| at % 3).filter(|step| *step > 0);
            let _ = writeln!(lines, "{}", json!({"coder": coder, "episode_id": id, "label": label, "step": step}));
        }
    }
    std::fs::write(runs.join("labels.jsonl"), lines).unwrap();
    folder
}

fn asked(folder: &Path, arguments: &[&str]) -> Answer {
    run(folder, arguments)
}

/// The number of episodes that `score` writes under a condition.
fn count(folder: &Path, condition: &str) -> usize {
    asked(folder, &["score", "runs", "--json", "--metrics", "TSA", "--where", condition]).done().lines().count()
}

#[test]
fn a_label_is_true_false_or_null_in_filters() {
    let folder = coded();
    let at = folder.path();
    // Of 14 episodes, Ann labels every second and Bob every third: one in six has both labels.
    assert_eq!(count(at, "label_confabulates"), 9);
    assert_eq!(count(at, "not label_confabulates"), 5);
    assert_eq!(count(at, "label_confabulates is null"), 42 - 14);
    assert_eq!(count(at, "label_confabulates = false and any(mirror_visible) is not null"), 5);
    let refused = asked(at, &["score", "runs", "--where", "label_confabulate"]).refused();
    assert!(refused.contains("did you mean `label_confabulates`?"), "{refused}");
    let refused =
        asked(at, &["score", "runs", "--engine", "spark", "--where", "label_confabulates", "-o", "s"]).refused();
    assert!(refused.contains("found a label beside them, which Spark does not read"), "{refused}");
}

#[test]
fn a_label_groups_cells_and_is_a_column_of_scores_and_queries() {
    let folder = coded();
    let at = folder.path();
    let study = Study::open([at.join("runs").as_os_str()]).unwrap().by(["label_confabulates"]);
    let cells = study.cells().unwrap();
    let counts: Vec<(String, u64)> =
        cells.all().filter(|cell| cell.name == "TSA").map(|cell| (cell.key[0].to_string(), cell.moments.n)).collect();
    let numbers: Vec<u64> = counts.iter().map(|(_, n)| *n).collect();
    assert_eq!((counts.len(), numbers.iter().sum::<u64>()), (3, 42), "{counts:?}");
    assert!(counts.contains(&("true".into(), 9)) && counts.contains(&("false".into(), 5)), "{counts:?}");
    let rows = asked(
        at,
        &[
            "query",
            "SELECT label_confabulates AS l, COUNT(*) AS n FROM episodes GROUP BY l ORDER BY n",
            "runs",
            "--format",
            "csv",
        ],
    );
    assert_eq!(rows.done(), "l,n\nfalse,5\ntrue,9\n,28\n");
    asked(at, &["score", "runs", "-o", "scores.parquet"]).done();
    let kept = asked(at, &["score", "scores.parquet", "--json", "--where", "label_confabulates and seed = 1"]).done();
    let first: Value = serde_json::from_str(kept.lines().next().unwrap()).unwrap();
    assert_eq!((kept.lines().count(), &first["label_confabulates"]), (5, &json!("true")));
}

#[test]
fn definitions_read_labels() {
    let folder = coded();
    let at = folder.path();
    let metric = "include = [\"paper\"]\n[column.label_confabulates]\ntype = \"bool\"\nconstant = true\n\
        [metric.CONF]\nvalue = \"label_confabulates\"\n[metric.WRONG]\nvalue = \"label_confabulates and not TSA\"\n";
    std::fs::write(at.join("mine.toml"), metric).unwrap();
    asked(at, &["definitions", "check", "mine.toml"]).done();
    let arguments = ["score", "runs", "--json", "--definitions", "mine.toml", "--metrics", "CONF,WRONG"];
    let rows: Vec<Value> =
        asked(at, &arguments).done().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let with = |value: Value| rows.iter().filter(|row| row["CONF"] == value).count();
    assert_eq!([with(json!(1)), with(json!(0)), with(Value::Null)], [9, 5, 28]);
    std::fs::remove_file(at.join("runs/labels.jsonl")).unwrap();
    let refused = asked(at, &["score", "runs", "--definitions", "mine.toml"]).refused();
    assert!(refused.contains("`label_confabulates`: no trace has it"), "{refused}");
}

#[test]
fn a_filter_by_labels_counts_as_a_filter_by_results() {
    let folder = coded();
    let by = |condition: &str| {
        let told = asked(folder.path(), &["stats", "runs", "--where", condition, "--json"]).json();
        told["where"]["by_results"].clone()
    };
    assert_eq!([by("label_confabulates is not null"), by("seed < 3")], [json!(true), json!(false)]);
}

#[test]
fn two_coders_have_a_kappa() {
    let folder = coded();
    let at = folder.path();
    let told = asked(at, &["trace", "labels", "runs", "--json"]).json();
    assert_eq!([&told["episodes"], &told["coded"], &told["elsewhere"]], [&json!(42), &json!(14), &json!(0)]);
    let pair = &told["agreement"][0];
    // `cohen_kappa_score` of sklearn 1.9.1 and `cohens_kappa` of statsmodels 0.15.0 over [[3, 4], [2, 5]].
    let number = |name: &str| pair.pointer(name).and_then(Value::as_f64).unwrap();
    for (name, expected) in KAPPA {
        assert!((number(name) - expected).abs() < 1e-12, "{name}: {pair}");
    }
    assert_shown!("trace labels runs", asked(at, &["trace", "labels", "runs"]).done());
    let few = asked(at, &["trace", "labels", "runs", "--where", "seed = 1"]).done();
    assert!(few.contains("cannot say: 7 episodes coded by both, expected 10"), "{few}");
    std::fs::write(at.join("runs/labels.jsonl"), "{\"coder\":\"ann\"}\n").unwrap();
    let refused = asked(at, &["trace", "labels", "runs"]).refused();
    assert!(
        refused.contains("labels.jsonl, line 1: expected a label") && refused.contains("missing field"),
        "{refused}"
    );
}

#[expect(clippy::unreadable_literal, reason = "reference values as their sources print them")]
const KAPPA: [(&str, f64); 4] = [
    ("/agreement", 8.0 / 14.0),
    ("/kappa", 0.1428571428571429),
    ("/interval/low", -0.353980930185409),
    ("/interval/high", 0.6396952158996946),
];
