//! The agents of `examples/agents/seeing.py` in the default world: frames, prompts, HTTP, replies, trace, metrics.

use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::loopback::Provider;
use crate::harness::need;
use crate::harness::program::run;

/// Records one seed with an agent, and returns the folder.
fn record(words: &[&str], experiments: &str, runs: &str) -> TempDir {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let server = Provider::serve("agents/seeing.py", words, &need::numpy());
    let address = format!("{}/v1", server.address);
    let mut command = vec!["record", "--agent", "vlm", "--model", "seeing", "--base-url", &address, "--no-log"];
    command.extend(["--experiment", experiments, "--seeds", "1", "--runs", runs, "--out", "runs"]);
    run(folder.path(), &command).done();
    folder
}

/// The rows that a query returns.
fn query(folder: &Path, sql: &str) -> Vec<Value> {
    let lines = run(folder, &["query", sql, "runs", "--format", "jsonl"]).done();
    lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn assert_all_replies_are_ok(folder: &Path) {
    let statuses = query(folder, "select reply_status, count(*) as steps from steps group by reply_status");
    assert_eq!(statuses.len(), 1, "{statuses:?}");
    assert_eq!(statuses[0]["reply_status"], "ok", "{statuses:?}");
}

/// Four successes of four: a random choice among three cubes has them once in 81 tries.
fn assert_finds_its_cube(folder: &Path) {
    let successes = query(folder, "select TSA from episodes");
    assert_eq!(successes, vec![json!({ "TSA": 1 }); 4]);
}

#[test]
fn the_seeing_agent_decides_in_all_five_experiments() {
    let folder = record(&[], "E1..E5", "1");
    assert_all_replies_are_ok(folder.path());
    let sql = "select experiment, self_color from steps where action = 'done' order by experiment";
    let decisions = query(folder.path(), sql);
    let experiments: Vec<&Value> = decisions.iter().map(|row| &row["experiment"]).collect();
    assert_eq!(experiments, ["E1", "E2", "E3", "E4", "E5"], "{decisions:?}");
    assert_eq!(decisions[1]["self_color"], "unknown", "E2 has no mirror: {decisions:?}");
}

#[test]
fn the_seeing_agent_finds_its_own_cube_in_e1() {
    let folder = record(&[], "E1", "4");
    assert_finds_its_cube(folder.path());
}

#[test]
fn the_trained_agent_finds_its_own_cube_in_e1() {
    let weights = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/agents/seeing.npz");
    let folder = record(&["--trained", weights], "E1", "4");
    assert_all_replies_are_ok(folder.path());
    assert_finds_its_cube(folder.path());
}
