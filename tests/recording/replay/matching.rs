//! A replay reproduces the recording.

use serde_json::Value;

use super::traces::{RECORDED, copy, recorded, replay};
use crate::harness::files::fixture;
use crate::harness::program::{run, stderr, stdout};
use crate::harness::traces::episodes;

#[test]
fn every_step_matches() {
    let steps: usize = ["E1", "E3", "E4", "decoy"]
        .iter()
        .flat_map(|experiment| episodes(&recorded(experiment)))
        .map(|episode| episode.steps.len())
        .sum();
    let answer = run(&RECORDED, &["world", "replay", ".", "--json"]).json();
    assert_eq!(answer["episodes"], 12);
    assert_eq!(answer["steps"], steps);
    assert_eq!(answer["divergences"].as_array().map(Vec::len), Some(0));
    // A copy without changes equals the recording.
    let (_folder, path) = copy("E4", |_, _| ());
    assert_eq!(std::fs::read(path).unwrap(), std::fs::read(recorded("E4")).unwrap());
}

#[test]
fn one_episode_can_be_replayed() {
    let output = replay(&recorded("E1"), &["--episode", "E1/random/s1/r2"]);
    assert!(stdout(&output).starts_with("1 episode, "), "{}", stdout(&output));
    let output = replay(&recorded("E1"), &["--episode", "E1/random/s1/r9"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("no trace has the episode `E1/random/s1/r9`"), "{}", stderr(&output));
}

#[test]
fn the_bundled_recordings_match() {
    let said = run(&fixture("recorded"), &["world", "replay", "E1-guesser.parquet", "E5-random.parquet"]).done();
    assert!(said.contains("all match"), "{said}");
}

#[test]
fn a_trace_without_its_world_is_refused() {
    let output = replay(&fixture("paper/E1-claude-sonnet-4-6.parquet"), &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("does not say how its world was made"), "{}", stderr(&output));
    assert!(stderr(&output).contains("help: traces of `mirrorstats record` do"), "{}", stderr(&output));
    for (key, value, expected) in [
        ("world", Value::Null, "cannot be read"),
        ("world_hash", "0123".into(), "expected the hash 0123, found "),
        ("scene_version", 99.into(), "version 99 of the scenes, and this program draws version 4"),
    ] {
        let (_folder, path) = copy("E1", |_, recording| recording[key] = value);
        let output = replay(&path, &[]);
        assert_eq!(output.status.code(), Some(2), "{key}");
        assert!(stderr(&output).contains(expected), "{key}: {}", stderr(&output));
        assert!(output.stdout.is_empty());
    }
}
