//! Invalid recordings are refused with one sentence and a remedy, and leave no files.

use std::fs;
use std::path::Path;

use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::write::merge;
use serde_json::{Value, json};

use super::recordings::Bench;
use crate::harness::files::{assert_same, fixture};
use crate::harness::program::{run, stderr};
use crate::harness::traces::{episodes, recording};

/// Checks that this is refused with these words and no others.
fn refused(bench: &Bench, out: &str, words: &str, expected: &[&str]) {
    let output = bench.record(out, words).output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{words}: {said}");
    for expected in expected {
        assert!(said.contains(expected), "{words}: expected `{expected}` in\n{said}");
    }
    assert!(output.stdout.is_empty());
    assert_eq!(said.matches("error: ").count(), 1, "{said}");
}

#[test]
fn an_unknown_agent_experiment_or_shard_is_refused() {
    let bench = Bench::new();
    for (words, expected) in [
        ("--agent oracel", "did you mean `oracle`?"),
        ("--agent frozen --experiment E6", "experiments such as E1, E1..E5, E1,E3 or mine.toml"),
        ("--agent frozen --experiment E3..E1", "experiments such as"),
        ("--agent frozen --shard 5/4", "a share such as 3/16"),
        ("--agent frozen --seeds 0", "--seeds"),
        ("--agent frozen --runs 0", "--runs"),
        ("--agent frozen --threads 0", "--threads"),
    ] {
        refused(&bench, "runs", words, &[expected]);
        assert!(!bench.path("runs").exists(), "{words}");
    }
}

#[test]
fn an_invalid_configuration_is_refused() {
    let bench = Bench::new();
    for (text, expected) in [
        ("room.sise = 8.0", "size"),
        ("[room]\nsize = 'big'", "small.toml:2:8"),
        ("room.size = 100.0", "`size` may be 5 to 12, but is 100"),
        ("episode.steps = 0", "`steps` may be 1 to 100000"),
    ] {
        fs::write(bench.path("small.toml"), text).unwrap();
        refused(&bench, "runs", "--agent frozen --experiment E1 --seeds 1 --runs 1", &["small.toml", expected]);
        assert!(!bench.path("runs").exists(), "{text}");
    }
    fs::remove_file(bench.path("small.toml")).unwrap();
    refused(&bench, "runs", "--agent frozen", &["small.toml", "cannot read the file"]);
}

#[test]
fn a_folder_that_cannot_be_created_is_reported() {
    let bench = Bench::new();
    fs::write(bench.path("file"), "").unwrap();
    for out in ["file", "file/runs"] {
        refused(&bench, out, "--agent frozen --experiment E1 --seeds 1 --runs 1", &["file", "help: "]);
    }
    assert_eq!(fs::read(bench.path("file")).unwrap(), b"");
}

#[test]
fn episodes_of_another_world_or_another_agent_are_not_mixed() {
    let bench = Bench::new();
    let words = "--agent random --experiment E1 --seeds 1 --runs 2";
    let before = bench.recorded("runs", words);
    let small = fs::read_to_string(bench.path("small.toml")).unwrap();
    fs::write(bench.path("small.toml"), format!("{small}episode.steps = 90\n")).unwrap();
    let expected =
        ["E1-random.parquet", "world", "steps", "expected 90, found 100", "help: record into another folder"];
    refused(&bench, "runs", "--agent random --experiment E1 --seeds 1 --runs 3", &expected);
    assert_same(&bench.files("runs"), &before);

    fs::write(bench.path("small.toml"), small).unwrap();
    fs::rename(bench.path("runs/E1-random.parquet"), bench.path("runs/E1-frozen.parquet")).unwrap();
    refused(
        &bench,
        "runs",
        &words.replace("random", "frozen"),
        &["agent.scripted", "expected \"frozen\", found \"random\""],
    );
}

/// Changes the recording's metadata in the trace.
fn alter(trace: &Path, change: impl FnOnce(&mut serde_json::Map<String, Value>)) {
    let mut recording = recording(trace);
    change(recording.as_object_mut().unwrap());
    merge::write(trace, Some(&recording), &episode_rows::read(trace).unwrap()).unwrap();
}

#[test]
fn a_recording_without_a_palette_is_of_another_version() {
    let bench = Bench::new();
    let words = "--agent random --experiment E1 --seeds 1 --runs 1";
    bench.recorded("runs", words);
    let trace = bench.path("runs/E1-random.parquet");
    alter(&trace, |recording| {
        recording.remove("palette");
        recording["version"] = 1.into();
    });
    let before = bench.files("runs");
    let expected = [
        "`runs/E1-random.parquet` was recorded with another version: expected 3, found 1",
        "help: record into another folder",
    ];
    refused(&bench, "runs", &words.replace("--runs 1", "--runs 2"), &expected);
    assert_same(&bench.files("runs"), &before);
    // The recording can still be scored and replayed.
    run(bench.folder.path(), &["score", "runs"]).done();
    run(bench.folder.path(), &["world", "replay", "runs/E1-random.parquet"]).done();
}

#[test]
fn a_colour_outside_of_the_palette_is_refused_wherever_the_recording_is_read() {
    let bench = Bench::new();
    bench.recorded("runs", "--agent random --experiment E1 --seeds 1 --runs 1");
    let trace = bench.path("runs/E1-random.parquet");
    let body = episodes(&trace).remove(0).body_color;
    // The palette lacks the body's colour, but has a similar one.
    let near = format!("{body}s");
    alter(&trace, |recording| recording["palette"] = json!([near, "unheard"]));
    for verb in ["score", "stats"] {
        let said = run(bench.folder.path(), &[verb, "runs"]).refused();
        let expected = format!("a colour of the palette ({near}, unheard)\n  found `{body}` (");
        assert!(said.contains("invalid-color: runs/E1-random.parquet") && said.contains(&expected), "{said}");
        assert!(said.contains(&format!("help: did you mean `{near}`?")), "{said}");
    }
    let checked = run(bench.folder.path(), &["trace", "validate", "runs"]).ends(1);
    assert!(checked.stdout.contains(&format!("did you mean `{near}`?")), "{}", checked.stdout);
}

#[test]
fn a_trace_that_is_damaged_or_of_another_recorder_is_not_written_over() {
    let bench = Bench::new();
    let words = "--agent random --experiment E1 --seeds 1 --runs 1";
    fs::create_dir(bench.path("runs")).unwrap();
    let place = bench.path("runs/E1-random.parquet");
    fs::write(&place, "no parquet").unwrap();
    refused(&bench, "runs", words, &["E1-random.parquet"]);
    assert_eq!(fs::read(&place).unwrap(), b"no parquet");

    let foreign = fixture("paper/E1-claude-sonnet-4-6.parquet");
    fs::copy(&foreign, &place).unwrap();
    refused(&bench, "runs", words, &["E1-random.parquet", "help: "]);
    assert_eq!(fs::read(&place).unwrap(), fs::read(&foreign).unwrap());
    assert_eq!(bench.files("runs").len(), 1);
}

#[test]
fn a_machine_that_cannot_render_is_reported() {
    let bench = Bench::new();
    // A vendor file that names a missing library leaves EGL without a driver.
    fs::write(bench.path("none.json"), r#"{"file_format_version":"1.0.0","ICD":{"library_path":"libnone.so"}}"#)
        .unwrap();
    let mut command = bench.record_with_frames("runs", "--agent random --experiment E1 --seeds 1 --runs 1");
    let output = command.env("__EGL_VENDOR_LIBRARY_FILENAMES", bench.path("none.json")).output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("libegl1 and libgl1-mesa-dri"), "{said}");
    assert!(!bench.path("runs").exists());
    // Recordings without pictures still work.
    let mut command = bench.record("runs", "--agent random --experiment E1 --seeds 1 --runs 1");
    let output = command.env("__EGL_VENDOR_LIBRARY_FILENAMES", bench.path("none.json")).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
}
