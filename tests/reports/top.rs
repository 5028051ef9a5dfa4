//! Figures of many models show only the best.

use std::collections::BTreeSet;

use serde_json::json;

use crate::harness::program::{answer, program, run};

const PAPER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/paper");

#[test]
fn a_figure_shows_the_best_models_alone() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["report", PAPER, "--out", "report", "--no-figures"]).done();
    let cells = std::fs::read_to_string(folder.path().join("report/cells.csv")).unwrap();
    let rows: Vec<Vec<&str>> = cells.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let models: BTreeSet<&str> = rows.iter().map(|row| row[1]).collect();
    let best = |metric: &str, sign: f64| {
        let mean = |model: &str| -> f64 {
            let of = rows.iter().filter(|row| row[1] == model && row[2] == metric);
            of.map(|row| row[6].parse::<f64>().unwrap()).sum()
        };
        let mut models: Vec<&str> = models.iter().copied().collect();
        models.sort_by(|a, b| (sign * mean(b)).total_cmp(&(sign * mean(a))));
        models[..3].iter().map(|model| (*model).to_owned()).collect::<BTreeSet<_>>()
    };
    for (figure, metric, sign) in
        [("intervals", "TSA", 1.0), ("intervals", "CR", -1.0), ("scatter", "TSA,MCR,TTD", 1.0)]
    {
        let svg = run(folder.path(), &["figure", figure, PAPER, "--metric", metric, "--top", "3"]).done();
        let is_shown = |model: &&&str| svg.contains(&format!(">{model}<"));
        let shown: BTreeSet<String> = models.iter().filter(is_shown).map(|model| (*model).to_owned()).collect();
        assert_eq!(shown, best(metric.split(',').next().unwrap(), sign), "{figure} {metric}");
    }
    let refused = run(folder.path(), &["figure", "intervals", PAPER, "--top", "0"]).refused();
    assert!(refused.contains("--top"), "{refused}");
}

#[test]
fn a_figure_of_many_models_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let line = |model: usize| {
        json!({
            "episode_id": format!("E1/m{model}/s1/r1"), "model": format!("m{model}"), "experiment": "E1", "seed": 1, "run": 1,
            "body_color": "red", "t": 1, "action": "done", "self_color": "red", "selected_cube": "red",
            "mirror_visible": true,
        })
        .to_string()
    };
    std::fs::write(folder.path().join("steps.jsonl"), (0..30).map(line).collect::<Vec<_>>().join("\n")).unwrap();
    run(folder.path(), &["import", "steps.jsonl", "-o", "many.parquet"]).done();
    let told = |more: &[&str]| {
        let arguments = [&["figure", "intervals", "many.parquet", "-o", "a.svg"], more].concat();
        answer(program(folder.path()).args(arguments)).ends(0).stderr
    };
    assert!(told(&[]).contains("30 models in one figure; --top 12"), "{}", told(&[]));
    assert!(!told(&["--top", "12"]).contains("models in one figure"));
}
