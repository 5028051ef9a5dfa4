//! Traces name their renderer, and recording, reading, pooling and replaying distinguish renderers.

use std::process::Command;

use mirrorstats_trace::episodes::episode_hash;
use mirrorstats_trace::write::{OptionalColumns, TraceMetadata, TraceWriter};
use serde_json::Value;

use super::recordings::Bench;
use crate::harness::need;
use crate::harness::program::{answer, program, run, stderr, succeeds};
use crate::harness::traces::{episodes, recording};

/// The same program with a renderer that may use fewer processor features.
fn limited(mut command: Command) -> Command {
    command.env("GALLIUM_OVERRIDE_CPU_CAPS", "sse2");
    command
}

fn renderers(bench: &Bench, trace: &str) -> Vec<Value> {
    let footer = recording(&bench.path(trace));
    let parts = footer["fingerprints"].as_object().unwrap().values();
    parts.filter_map(|parts| parts.get("renderer").cloned()).collect()
}

#[test]
fn two_renderers_are_told_apart_everywhere() {
    need::drawing();
    let bench = Bench::new();
    let shard = |at: &str| format!("--agent mimic --experiment E1 --seeds 1 --runs 2 --no-log --shard {at}");
    let said = stderr(&succeeds(&mut bench.record("one", &shard("1/2"))));
    assert!(said.contains("frames: drawn by "), "{said}");
    succeeds(&mut limited(bench.record("two", &shard("2/2"))));
    let (one, two) = (renderers(&bench, "one/E1-mimic.parquet"), renderers(&bench, "two/E1-mimic.parquet"));
    assert_eq!((one.len(), two.len()), (1, 1));
    assert!(two[0]["processor"].as_str().unwrap().ends_with("limited to sse2"), "{two:?}");
    assert!(one[0]["name"].is_string() && one[0]["version"].is_string() && one != two, "{one:?}");

    // Traces name the renderer, and no cell mixes renderers unless asked.
    let folder = bench.folder.path();
    let info = run(folder, &["trace", "info", "one", "two", "--json"]).json();
    assert_eq!(info["renderers"], serde_json::json!([one[0], two[0]]));
    assert!(run(folder, &["trace", "info", "one", "two"]).done().contains("renderers      2   "));
    let refused = run(folder, &["report", "one", "two"]).refused();
    assert!(refused.contains("they differ in renderer.") && refused.contains("--pool takes all"), "{refused}");
    let pooled = run(folder, &["report", "one", "two", "--pool", "--out", "pooled"]).ends(0);
    assert!(pooled.stderr.contains("agents saw frames of 2 renderers, which may differ: "), "{}", pooled.stderr);
    let page = std::fs::read_to_string(bench.path("pooled/report.html")).unwrap();
    assert!(page.contains("they differ in renderer."), "the report names them");

    // Each frame is compared: equal bytes, or similar pictures.
    let steps: usize = episodes(&bench.path("one/E1-mimic.parquet")).iter().map(|episode| episode.steps.len()).sum();
    let replay = |command: Command| {
        let mut command = command;
        answer(command.args(["world", "replay", "one/E1-mimic.parquet", "--json"])).json()["frames"].clone()
    };
    let same = replay(program(folder));
    assert_eq!((&same["equal"], &same["alike"], &same["different"]), (&steps.into(), &0.into(), &0.into()));
    assert_eq!(same["drawn_with"], same["recorded_with"][0]);
    let other = replay(limited(program(folder)));
    assert_eq!((&other["different"], &other["recorded_with"][0], &other["drawn_with"]), (&0.into(), &one[0], &two[0]));
    assert!(other["alike"].as_u64().unwrap() > 0, "{other}");
}

#[test]
fn a_frame_with_other_contents_is_reported_as_different() {
    need::drawing();
    let bench = Bench::new();
    succeeds(&mut bench.record("runs", "--agent mimic --experiment E1 --seeds 1 --runs 1 --no-log"));
    let path = bench.path("runs/E1-mimic.parquet");
    let mut all = episodes(&path);
    let digests: Vec<_> = all[0].steps.iter().map(|step| step.extra.frame_digest.clone().unwrap()).collect();
    assert_ne!(digests[0], digests[1]);
    all[0].steps[1].extra.frame_digest = Some(digests[0].clone());
    all[0].episode_hash = Some(episode_hash::hash_of(&all[0]));
    let footer = recording(&path);
    let columns = OptionalColumns::recorded(&footer);
    let mut writer = TraceWriter::create(&path, &TraceMetadata { recording: Some(footer), columns }).unwrap();
    writer.write(&all[0]).unwrap();
    writer.commit().unwrap();
    let replayed = run(bench.folder.path(), &["world", "replay", "runs/E1-mimic.parquet"]).ends(1);
    let said = &replayed.stdout;
    assert!(
        said.contains("E1/mimic/s1/r1, t = 2: frame_digest: recorded ") && said.contains(", 1 different"),
        "{said}"
    );
}

#[test]
fn agents_that_see_no_frames_are_comparable_whatever_draws() {
    let bench = Bench::new();
    let shard = |at: &str| format!("--agent random --experiment E1 --seeds 1 --runs 2 --no-log --shard {at}");
    succeeds(&mut bench.record("one", &shard("1/2")));
    succeeds(&mut limited(bench.record("two", &shard("2/2"))));
    let prints = ["one", "two"].map(|folder| {
        let path = bench.path(&format!("{folder}/E1-random.parquet"));
        assert_eq!(recording(&path).get("frame_digest"), None);
        episodes(&path)[0].fingerprint.clone()
    });
    assert_eq!(prints[0], prints[1]);
    assert!(renderers(&bench, "one/E1-random.parquet").is_empty());
    run(bench.folder.path(), &["report", "one", "two", "--out", "report"]).done();
}
