//! An existing log: continued if it belongs to the trace, otherwise refused, and never lost.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use mirrorstats_log::recover::recover;
use mirrorstats_trace::write::write_episodes;

use super::recordings::Bench;
use crate::harness::files::assert_same;
use crate::harness::program::{run, stderr};
use crate::harness::traces::{episodes, recording};

fn words(runs: u32) -> String {
    format!("--agent random --experiment E1 --seeds 1 --runs {runs} --threads 1")
}

/// Checks that recording is refused with these words and does not change the folder.
fn refused(bench: &Bench, words: &str, expected: &[&str]) {
    let before = bench.files("runs");
    for more in ["", " --no-log", " --dry-run"] {
        let output = bench.record("runs", &format!("{words}{more}")).output().unwrap();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{words}{more}: {said}");
        for expected in expected {
            assert!(said.contains(expected), "{words}{more}: expected `{expected}` in\n{said}");
        }
        assert_same(&bench.files("runs"), &before);
    }
}

fn remove(bench: &Bench, ending: &str) {
    fs::remove_file(bench.path("runs").join(format!("E1-random.{ending}"))).unwrap();
}

fn recover_into(bench: &Bench, trace: &str) {
    run(bench.folder.path(), &["trace", "recover", "runs/E1-random.mcap", "-o", trace]).done();
}

#[test]
fn a_log_without_its_trace_is_not_added_to_under_another_configuration() {
    let bench = Bench::new();
    let before = bench.recorded("runs", &words(2));
    remove(&bench, "parquet");
    let small = fs::read_to_string(bench.path("small.toml")).unwrap();
    fs::write(bench.path("small.toml"), format!("{small}episode.steps = 41\n")).unwrap();
    let expected = [
        "the log `runs/E1-random.mcap` does not belong to this recording: it was recorded with another world.episode.steps",
        "expected 41, found 100",
        "help: `mirrorstats trace recover runs/E1-random.mcap -o TRACE.parquet` makes a trace of it; move the log away",
    ];
    refused(&bench, &words(2), &expected);
    // The advice in the message works.
    recover_into(&bench, "old.parquet");
    assert!(fs::read(bench.path("old.parquet")).unwrap() == before["E1-random.parquet"]);
    fs::rename(bench.path("runs/E1-random.mcap"), bench.path("old.mcap")).unwrap();
    let whole = bench.recorded("whole", &words(2));
    assert_same(&bench.recorded("runs", &words(2)), &whole);
}

#[test]
fn a_missing_trace_can_be_recovered_from_its_log() {
    let bench = Bench::new();
    let whole = bench.recorded("whole", &words(3));
    bench.recorded("runs", &words(2));
    remove(&bench, "parquet");
    let expected = [
        "does not belong to this recording: it holds the episode `E1/random/s1/r1`, and there is no trace `runs/E1-random.parquet`",
        "help: `mirrorstats trace recover runs/E1-random.mcap -o runs/E1-random.parquet` makes its trace again",
    ];
    refused(&bench, &words(3), &expected);
    recover_into(&bench, "runs/E1-random.parquet");
    assert_same(&bench.recorded("runs", &words(3)), &whole);
}

#[test]
fn a_log_with_an_episode_missing_from_the_trace_is_refused() {
    let bench = Bench::new();
    let more = bench.recorded("more", &words(3));
    bench.recorded("runs", &words(2));
    fs::write(bench.path("runs/E1-random.mcap"), &more["E1-random.mcap"]).unwrap();
    let expected = ["it holds the episode `E1/random/s1/r3`, which is not in `runs/E1-random.parquet`", "help: "];
    refused(&bench, &words(4), &expected);
}

/// Changes a count in the trace's first episode.
fn alter(trace: &Path, value: i32) {
    let mut all = episodes(trace);
    all[0].steps.iter_mut().for_each(|step| step.extra.mirror_px = Some(value));
    write_episodes(trace, Some(recording(trace)), &all).unwrap();
}

#[test]
fn a_log_with_different_rows_is_refused() {
    let bench = Bench::new();
    bench.recorded("runs", &words(2));
    alter(&bench.path("runs/E1-random.parquet"), 123_456);
    let expected = [
        "its episode `E1/random/s1/r1` is not that of `runs/E1-random.parquet`: at t = 1, mirror_px: expected 123456, found ",
        "help: ",
    ];
    refused(&bench, &words(3), &expected);
}

#[test]
fn a_removed_log_starts_again_with_new_episodes() {
    let bench = Bench::new();
    let whole = bench.recorded("whole", &words(4));
    bench.recorded("runs", &words(2));
    remove(&bench, "mcap");
    for runs in [2, 3, 4] {
        bench.recorded("runs", &words(runs));
    }
    let files = bench.files("runs");
    assert!(files["E1-random.parquet"] == whole["E1-random.parquet"]);
    let ids = |log: &str| -> Vec<String> {
        recover(&bench.path(log)).unwrap().episodes.into_iter().map(|episode| episode.episode_id).collect()
    };
    assert_eq!(ids("runs/E1-random.mcap"), ["E1/random/s1/r3", "E1/random/s1/r4"]);
}

#[test]
fn a_log_assembled_before_its_trace_is_continued() {
    let bench = Bench::new();
    let whole = bench.recorded("whole", &words(2));
    // The state after a kill between the two: the episodes wait as parts, and the log already has them.
    let parts: BTreeMap<String, Vec<u8>> = (1..=2)
        .flat_map(|run| {
            let one = bench.recorded(&format!("one-{run}"), &format!("{} --shard {run}/2", words(2)));
            let name = |ending: &str| format!("E1-random-s1-r{run}.{ending}");
            ["mcap", "parquet"].map(|ending| (name(ending), one[&format!("E1-random.{ending}")].clone()))
        })
        .collect();
    fs::create_dir_all(bench.path("runs/.parts")).unwrap();
    for (name, bytes) in parts {
        fs::write(bench.path("runs/.parts").join(name), bytes).unwrap();
    }
    fs::write(bench.path("runs/E1-random.mcap"), &whole["E1-random.mcap"]).unwrap();
    assert_same(&bench.recorded("runs", &words(2)), &whole);
}
