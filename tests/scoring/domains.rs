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
use serde_json::json;

use crate::harness::files::repository;
use crate::harness::logs;
use crate::harness::program::run;
use crate::metamorphic::engines::{Engine, Rows, answers_about};

/// Definitions, the traces for them, and the first metrics of each episode, worked out by hand.
type Domain = (&'static str, fn(&Path) -> Vec<&'static str>, &'static [&'static str], [[Option<i64>; 3]; 4]);

const DOMAINS: [Domain; 2] = [
    (
        "robots",
        robots,
        &["SUCCESS", "TIME", "DURATION"],
        // Solved at frame 2, never, at frame 0, and at frame 7; `t` counts from 1.
        [
            [Some(1), Some(3), Some(3)],
            [Some(0), None, Some(8)],
            [Some(1), Some(1), Some(1)],
            [Some(1), Some(8), Some(8)],
        ],
    ),
    (
        "tools",
        tools,
        &["SUCCESS", "STEPS", "REPEATS"],
        [[Some(1), Some(3), Some(1)], [Some(0), None, Some(1)], [Some(1), Some(3), Some(0)], [Some(0), None, Some(0)]],
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
