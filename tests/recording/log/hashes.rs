//! The hash of an episode, in its trace and at its end in the log: a mismatch is detected.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use mirrorstats_log::read::episode_hashes;
use mirrorstats_trace::episodes::episode_hash;
use mirrorstats_trace::read::episode_rows;
use mirrorstats_trace::write::write_episodes;
use serde_json::Value;

use super::logs::{Desk, RECORDING, SHORT, ids, json, recovered};
use crate::harness::files::{fixture, write_small_world};
use crate::harness::program::run;
use crate::harness::traces::{episodes, recording};

/// The log with another value in the first decision that has the key, and with valid checksums: the work of a program
/// that does not know the hash.
fn edited(key: &str, value: &Value) -> Vec<u8> {
    let mut out = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    let summary = mcap::Summary::read(&RECORDING.log).unwrap().unwrap();
    for index in &summary.metadata_indexes {
        out.write_metadata(&mcap::read::metadata(&RECORDING.log, index).unwrap()).unwrap();
    }
    let mut is_open = true;
    for message in mcap::MessageStream::new(&RECORDING.log).unwrap() {
        let mut message = message.unwrap();
        if is_open && message.channel.topic == "/decision" {
            let mut row: Value = serde_json::from_slice(&message.data).unwrap();
            assert_ne!(row[key], *value);
            row[key] = value.clone();
            message.data = serde_json::to_vec(&row).unwrap().into();
            is_open = false;
        }
        out.write(&message).unwrap();
    }
    out.finish().unwrap();
    out.into_inner().into_inner()
}

/// Changes a count in the first episode of the trace at `path`, which gives it another hash.
fn alter(path: &Path) {
    let mut all = episodes(path);
    all[0].steps.iter_mut().for_each(|step| step.extra.mirror_px = Some(123_456));
    write_episodes(path, Some(recording(path)), &all).unwrap();
}

#[test]
fn log_trace_and_rows_have_the_same_episode_hash() {
    let desk = Desk::new();
    fs::write(desk.trace(), &RECORDING.trace).unwrap();
    fs::write(desk.trace().with_extension("mcap"), &RECORDING.log).unwrap();
    let logged = episode_hashes(&desk.trace().with_extension("mcap")).unwrap();
    let traced = episode_rows::read(&desk.trace()).unwrap();
    assert_eq!((logged.len(), traced.len()), (3, 3));
    for rows in traced {
        let hash = episode_hash::hash_of(&rows.episode().unwrap());
        assert_eq!((rows.stated_hash().as_ref(), logged.get(&rows.episode_id)), (Some(&hash), Some(&hash)));
    }
}

#[test]
fn an_episode_whose_rows_do_not_match_its_end_record_is_lost() {
    let desk = Desk::new();
    let all = RECORDING.ended(RECORDING.log.len());
    let edited = edited("mirror_px", &123_456.into());
    assert_eq!(ids(&recovered(&edited)), all[1..]);
    let output = desk.recover(&edited, &["--json"]);
    assert_eq!(output.status.code(), Some(3));
    let lost = json(&output)["losses"]["episodes"][0].clone();
    assert_eq!(lost["episode_id"], all[0]);
    let reason = lost["reason"].as_str().unwrap();
    assert!(reason.starts_with("its rows do not match its end: expected the hash "), "{reason}");
    assert_eq!(desk.validated(), all[1..]);
}

#[test]
fn a_trace_with_other_rows_than_the_log_is_not_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_small_world(folder.path(), SHORT);
    fs::write(path("log.mcap"), &RECORDING.log).unwrap();
    fs::write(path("trace.parquet"), &RECORDING.trace).unwrap();
    alter(&path("trace.parquet"));
    run(folder.path(), &["trace", "validate", "trace.parquet"]).done();
    let before = fs::read(path("trace.parquet")).unwrap();
    let said = run(folder.path(), &["trace", "recover", "log.mcap", "-o", "trace.parquet"]).refused();
    assert!(said.contains("do not belong together") && said.contains("E1/random/s1/r1"), "{said}");
    assert!(fs::read(path("trace.parquet")).unwrap() == before);
}

#[test]
fn a_log_with_other_rows_than_the_trace_is_not_replaced_by_its_replay() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("log.mcap"), &RECORDING.log).unwrap();
    fs::write(path("trace.parquet"), &RECORDING.trace).unwrap();
    alter(&path("trace.parquet"));
    let said = run(folder.path(), &["world", "replay", "trace.parquet", "--mcap", "log.mcap"]).refused();
    assert!(said.contains("do not belong together") && said.contains("`trace.parquet` and `log.mcap`"), "{said}");
    assert!(fs::read(path("log.mcap")).unwrap() == RECORDING.log);
}

#[test]
fn a_film_strip_of_a_mismatched_log_and_trace_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("E1-guesser.parquet");
    fs::copy(fixture("recorded/E1-guesser.mcap"), folder.path().join("E1-guesser.mcap")).unwrap();
    fs::copy(fixture("recorded/E1-guesser.parquet"), &trace).unwrap();
    let strip = |out: &str| run(folder.path(), &["world", "filmstrip", "E1/guesser/s1/r1", ".", "--out", out]);
    strip("whole.svg").done();
    alter(&trace);
    let said = strip("parted.svg").refused();
    assert!(said.contains("do not belong together") && said.contains("E1-guesser.mcap"), "{said}");
    assert!(!folder.path().join("parted.svg").exists());
}
