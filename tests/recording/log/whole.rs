//! A log that is whole.

use std::fs;

use super::logs::{Desk, RECORDING, SHORT, json};
use crate::harness::files::{fixture, write_small_world};
use crate::harness::program::{run, succeeds, typed};

#[test]
fn it_gives_the_trace_byte_for_byte() {
    let desk = Desk::new();
    let output = desk.recover(&RECORDING.log, &["--json"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(fs::read(desk.trace()).unwrap() == RECORDING.trace, "the trace of the log has other bytes");
    let answer = json(&output);
    assert_eq!((&answer["episodes"], &answer["written"]), (&3.into(), &true.into()));
    assert_eq!(answer["losses"]["episodes"].as_array().unwrap().len(), 0);
}

#[test]
fn the_bundled_log_with_frames_gives_the_bundled_trace() {
    let bundled = |name: &str| fixture("recorded").join(name);
    let desk = Desk::new();
    let output = desk.recover(&fs::read(bundled("E1-guesser.mcap")).unwrap(), &[]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(fs::read(desk.trace()).unwrap() == fs::read(bundled("E1-guesser.parquet")).unwrap());
}

#[test]
fn other_files_than_logs_are_refused_and_nothing_is_written() {
    let desk = Desk::new();
    let mut foreign = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    foreign.add_channel(0, "/odometry", "json", &std::collections::BTreeMap::new()).unwrap();
    foreign.finish().unwrap();
    let foreign = foreign.into_inner().into_inner();
    for (bytes, expected) in [
        (&b""[..], "does not begin as an MCAP file does"),
        (b"PAR1 and so on", "does not begin as an MCAP file does"),
        (&RECORDING.trace, "does not begin as an MCAP file does"),
        (&foreign, "no topic /episode"),
    ] {
        let output = desk.recover(bytes, &[]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("`cut.mcap` is no log of a recording") && said.contains(expected), "{said}");
        assert!(output.stdout.is_empty() && !desk.trace().exists());
    }
}

#[test]
fn a_trace_that_has_more_than_the_log_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_small_world(folder.path(), SHORT);
    let words = "record --config small.toml --agent random --experiment E1 --seeds 1 --no-frames --runs";
    let record = |more: &str| succeeds(&mut typed(folder.path(), &format!("{words} {more}")));
    let recover = |trace: &str| run(folder.path(), &["trace", "recover", "log.mcap", "-o", trace]);
    fs::write(path("log.mcap"), &RECORDING.log).unwrap();
    record("4 --out more");
    write_small_world(folder.path(), &format!("{SHORT}eye.fovy = 90.0\n"));
    record("3 --out other");
    for (trace, expected) in [
        ("more/E1-random.parquet", "has the episode `E1/random/s1/r4`, which cannot be recovered from the log"),
        ("other/E1-random.parquet", "is a trace of another recording than the log"),
    ] {
        let before = fs::read(path(trace)).unwrap();
        let said = recover(trace).refused();
        assert!(said.contains(trace) && said.contains(expected) && said.contains("help: name another file"), "{said}");
        assert!(fs::read(path(trace)).unwrap() == before);
    }
    // Recovery replaces a trace of the same recording, and a file that is no longer a trace.
    for before in [&RECORDING.trace[..], &RECORDING.trace[..1_000]] {
        fs::write(path("trace.parquet"), before).unwrap();
        recover("trace.parquet").ends(0);
        assert!(fs::read(path("trace.parquet")).unwrap() == RECORDING.trace);
    }
}

#[test]
fn a_missing_log_and_an_unwritable_output_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("whole.mcap"), &RECORDING.log).unwrap();
    for (words, expected) in [
        (["trace", "recover", "none.mcap", "-o", "trace.parquet"], "cannot open the log `none.mcap`"),
        (["trace", "recover", "whole.mcap", "-o", "none/trace.parquet"], "none/trace.parquet"),
    ] {
        let said = run(folder.path(), &words).refused();
        assert!(said.contains(expected), "{said}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}
