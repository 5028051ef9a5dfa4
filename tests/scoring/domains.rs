//! Definitions of domains without a mirror, on every engine: robot policies of a LeRobot data set, and agents that use
//! tools.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mirrorstats_metric::definitions::Definitions;
use mirrorstats_score::vocabulary::trace_columns;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use serde_json::{Value, json};

use crate::harness::files::repository;
use crate::harness::logs;
use crate::harness::program::run;
use crate::metamorphic::engines::{Engine, Rows, answers_about};

/// Definitions, the traces for them, and the first metrics of each episode, worked out by hand.
type Domain = (&'static str, fn(&Path) -> Vec<&'static str>, &'static [&'static str], [&'static [Option<i64>]; 4]);

const DOMAINS: [Domain; 3] = [
    (
        "robots",
        robots,
        &["SUCCESS", "TIME", "DURATION"],
        // Solved at frame 2, never, at frame 0, and at frame 7; `t` counts from 1.
        [
            &[Some(1), Some(3), Some(3)],
            &[Some(0), None, Some(8)],
            &[Some(1), Some(1), Some(1)],
            &[Some(1), Some(8), Some(8)],
        ],
    ),
    (
        "navigation",
        navigation,
        &["SUCCESS", "FINAL", "FORCE", "MEAN_FORCE", "PATH", "NEAR"],
        // In units of the last digit: 0.30 m is 30, 1.2 N is 1200.
        [
            &[Some(1), Some(30), Some(1200), Some(501), Some(105), Some(1)],
            &[Some(0), Some(-1), Some(-1), Some(-1), Some(0), Some(1)],
            &[Some(0), Some(1235), None, None, Some(620), Some(0)],
            &[Some(0), None, Some(3), Some(3), None, Some(0)],
        ],
    ),
    (
        "tools",
        tools,
        &["SUCCESS", "STEPS", "REPEATS"],
        [
            &[Some(1), Some(3), Some(1)],
            &[Some(0), None, Some(1)],
            &[Some(1), Some(3), Some(0)],
            &[Some(0), None, Some(0)],
        ],
    ),
];

fn robots(folder: &Path) -> Vec<&'static str> {
    logs::lerobot_data_set(&folder.join("source"), &[Some(2), None, Some(0), Some(7)], false);
    vec!["source", "--set", "model=m", "--set", "experiment=pusht", "--set", "seed=1"]
}

/// Four samples: two are solved with the right tool. The first two repeat a call in consecutive steps.
fn tools(folder: &Path) -> Vec<&'static str> {
    let mut lines = String::new();
    for sample in 0..4 {
        for t in 1..=3 {
            let tool = (t > 1).then_some(if sample < 2 || t == 2 { "search" } else { "read" });
            let step = json!({
                "episode_id": format!("s{sample}"), "model": "m", "experiment": "task", "seed": 1, "run": sample + 1, "t": t,
                "kind": if t == 1 { "model" } else { "tool" }, "tool": tool, "arguments": tool.map(|_| "{}"), "error": null,
                "cost_micro_usd": 10 * t, "score": if sample % 2 == 0 { 1.0 } else { 0.0 }, "right_tool": "read",
            });
            writeln!(lines, "{step}").unwrap();
        }
    }
    fs::write(folder.join("source"), lines).unwrap();
    vec!["source", "--from", "jsonl"]
}

/// Each value is one whose double is not the decimal, or lies at a half of the last digit.
fn navigation(folder: &Path) -> Vec<&'static str> {
    let episodes: [&[(Value, Value)]; 4] = [
        &[(json!(1.1), json!(0.3)), (json!(0.7), json!(0.0025)), (json!(0.3), json!(1.2))],
        &[(json!(-0.005), json!(-0.0005))],
        &[(json!(12.345), Value::Null)],
        &[(Value::Null, json!(0.003))],
    ];
    let mut lines = String::new();
    for (episode, steps) in episodes.iter().enumerate() {
        for (t, (distance, force)) in (1..).zip(*steps) {
            let step = json!({
                "episode_id": format!("n{episode}"), "model": "m", "experiment": "kitchen", "seed": 1,
                "run": episode + 1, "t": t, "distance": distance, "force": force, "success": episode == 0 && t == 3,
            });
            writeln!(lines, "{step}").unwrap();
        }
    }
    fs::write(folder.join("source"), lines).unwrap();
    vec!["source", "--from", "jsonl"]
}

fn check(engine: Engine) {
    for (domain, write, metrics, expected) in DOMAINS {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        let definitions = repository().join(format!("examples/domains/{domain}.toml"));
        let name = definitions.to_str().unwrap();
        fs::create_dir(at.join("traces")).unwrap();
        let words = [&["import"], &write(at)[..], &["-o", "traces/a.parquet", "--definitions", name]].concat();
        run(at, &words).done();
        let traces = TraceSet::open(&[Input::new(at.join("traces/a.parquet"))]).unwrap();
        let definitions = Definitions::load(&definitions, &trace_columns(&traces)).unwrap();
        let Rows { names, values } = answers_about(engine, at, traces, definitions).unwrap();
        let found: BTreeMap<&String, Vec<Option<i64>>> = values
            .iter()
            .map(|(id, row)| (id, metrics.iter().map(|name| row[place(&names, name)]).collect()))
            .collect();
        let expected: Vec<Vec<Option<i64>>> = expected.iter().map(|row| row.to_vec()).collect();
        assert_eq!(found.into_values().collect::<Vec<_>>(), expected, "{engine:?}, {domain}");
    }
}

fn place(names: &[String], name: &str) -> usize {
    names.iter().position(|known| known == name).unwrap_or_else(|| panic!("no {name} among {names:?}"))
}

#[test]
fn native_matches_worked_examples() {
    check(Engine::Native);
}

#[test]
fn duckdb_runs_the_sql_of_other_domains() {
    check(Engine::Duckdb);
}

#[test]
fn spark_runs_the_sql_of_other_domains() {
    check(Engine::Spark);
}
