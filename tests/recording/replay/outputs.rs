//! A replay never replaces its trace or other episodes, and an old log stays until the new one is complete.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Output;

use tempfile::TempDir;

use super::traces::{copy, recorded, replay};
use crate::harness::files::{fixture, write_small_world};
use crate::harness::need;
use crate::harness::program::{limited, program, stderr, succeeds, typed};
use crate::harness::traces::episodes;

#[test]
fn the_trace_is_refused_as_the_output_under_any_name() {
    let (folder, path) = copy("E1", |_, _| ());
    symlink("copy.parquet", folder.path().join("soft.parquet")).unwrap();
    fs::hard_link(&path, folder.path().join("hard.parquet")).unwrap();
    let before = fs::read(&path).unwrap();
    for name in ["copy.parquet", "./copy.parquet", "soft.parquet", "hard.parquet"] {
        let output = replay(&path, &["--mcap", name]);
        assert_eq!(output.status.code(), Some(2), "{name}");
        assert!(stderr(&output).contains("--mcap is the trace itself"), "{name}: {}", stderr(&output));
        assert!(fs::read(&path).unwrap() == before, "{name}");
    }
}

#[test]
fn a_frame_does_not_replace_the_trace() {
    let folder = tempfile::tempdir().unwrap();
    let id = episodes(&recorded("E1"))[0].episode_id.replace('/', "-");
    let path = folder.path().join(id).join("t001.png");
    fs::create_dir(path.parent().unwrap()).unwrap();
    fs::copy(recorded("E1"), &path).unwrap();
    let output = program(folder.path()).args(["world", "replay"]).arg(&path).args(["--frames", "."]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("expected another file to write"), "{}", stderr(&output));
    assert!(fs::read(&path).unwrap() == fs::read(recorded("E1")).unwrap());
}

#[test]
fn a_film_strip_does_not_replace_its_log_or_trace() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ["mcap", "parquet"] {
        let source = fixture(&format!("recorded/E1-guesser.{ending}"));
        let path = folder.path().join(format!("a.{ending}"));
        fs::copy(source, &path).unwrap();
        symlink(&path, folder.path().join(format!("{ending}.svg"))).unwrap();
        let before = fs::read(&path).unwrap();
        let (input, out) = (format!("a.{ending}"), format!("{ending}.svg"));
        let mut command = program(folder.path());
        let output = command.args(["world", "filmstrip", "E1/guesser/s1/r1", &input, "--out", &out]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{ending}");
        assert!(stderr(&output).contains("expected another file to write"), "{}", stderr(&output));
        assert!(fs::read(&path).unwrap() == before);
    }
}

#[test]
fn a_log_is_not_replaced_by_the_trace_that_it_gives() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("a.mcap");
    fs::copy(fixture("recorded/E1-guesser.mcap"), &log).unwrap();
    symlink("a.mcap", folder.path().join("a.parquet")).unwrap();
    let before = fs::read(&log).unwrap();
    for out in ["a.mcap", "./a.mcap", "a.parquet"] {
        let output = program(folder.path()).args(["trace", "recover", "a.mcap", "--out", out]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{out}");
        assert!(stderr(&output).contains("expected another file to write"), "{}", stderr(&output));
        assert!(fs::read(&log).unwrap() == before, "{out}");
    }
}

/// A folder with `E1-random.parquet`, two episodes, and its log without frames.
fn with_log() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_small_world(folder.path(), "episode.steps = 40\n");
    let words = "record --config small.toml --out . --agent random --experiment E1 --seeds 1 --runs 2 --no-frames";
    succeeds(&mut typed(folder.path(), words));
    folder
}

#[test]
fn one_episode_does_not_take_the_place_of_a_log_with_others() {
    let folder = with_log();
    let log = folder.path().join("E1-random.mcap");
    let before = fs::read(&log).unwrap();
    let words = ["world", "replay", "E1-random.parquet", "--episode", "E1/random/s1/r2", "--mcap"];
    for (name, found) in [("E1-random.mcap", "one with the episode `E1/random/s1/r1`"), ("cut", "cannot be read")] {
        fs::write(folder.path().join("cut"), &before[..before.len() / 3]).unwrap();
        let old = fs::read(folder.path().join(name)).unwrap();
        let output = program(folder.path()).args(words).arg(name).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{name}");
        assert!(stderr(&output).contains(found), "{name}: {}", stderr(&output));
        assert!(stderr(&output).contains("help: give --mcap another name"), "{}", stderr(&output));
        assert!(fs::read(folder.path().join(name)).unwrap() == old, "{name}");
    }
    // A replay may replace a log of the same episode; a replay of all may replace the whole log.
    need::drawing();
    for (words, count) in [(&words[..], 1), (&words, 1), (&["world", "replay", "E1-random.parquet", "--mcap"], 2)] {
        succeeds(program(folder.path()).args(words).arg("again.mcap"));
        succeeds(program(folder.path()).args(["trace", "recover", "again.mcap", "--out", "again.parquet"]));
        assert_eq!(episodes(&folder.path().join("again.parquet")).len(), count);
    }
}

/// Replays onto `again.mcap` with file sizes limited to `bytes`: writing more fails, whether or not the signal is
/// ignored.
fn replay_within(folder: &Path, bytes: usize, is_ignored: bool) -> Output {
    let ignored = if is_ignored { "trap '' XFSZ; " } else { "" };
    let mut command = limited(folder, &format!("{ignored}ulimit -f {}", bytes / 512));
    command.args(["world", "replay"]).arg(recorded("E1")).args(["--mcap", "again.mcap"]).output().unwrap()
}

#[test]
fn an_old_log_stays_where_there_is_no_room_for_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    let words = ["--mcap", "again.mcap"];
    need::drawing();
    succeeds(program(folder.path()).args(["world", "replay"]).arg(recorded("E1")).args(words));
    let log = folder.path().join("again.mcap");
    let whole = fs::read(&log).unwrap();
    // There is room for each episode's own log, but not for the log of all three.
    let old = [&whole[..], b"an older log"].concat();
    fs::write(&log, &old).unwrap();
    for is_ignored in [false, true] {
        let output = replay_within(folder.path(), whole.len() * 2 / 3, is_ignored);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains("cannot write the log `again.mcap`"), "{}", stderr(&output));
        assert!(fs::read(&log).unwrap() == old, "the old log has changed");
    }
    succeeds(program(folder.path()).args(["world", "replay"]).arg(recorded("E1")).args(words));
    assert!(fs::read(&log).unwrap() == whole, "the new log is not in place of the old one");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "something is left over");
}
