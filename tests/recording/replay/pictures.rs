//! Frames, logs and film strips of recorded episodes.

use std::fs;
use std::path::Path;

use super::traces::recorded;
use crate::harness::files::fixture;
use crate::harness::need;
use crate::harness::program::{limited, program, stderr, succeeds, typed};
use crate::harness::traces::episodes;

#[test]
fn a_replay_writes_frames_and_a_log() {
    let folder = tempfile::tempdir().unwrap();
    need::drawing();
    let mut command = program(folder.path());
    command.args(["world", "replay"]).arg(recorded("E1")).args(["--frames", "frames", "--mcap", "again.mcap"]);
    succeeds(&mut command);
    for episode in episodes(&recorded("E1")) {
        let name = episode.episode_id.replace('/', "-");
        for t in 1..=episode.steps.len() {
            let png = fs::read(folder.path().join(format!("frames/{name}/t{t:03}.png"))).unwrap();
            assert_eq!(png[16..24], [0, 0, 0, 64, 0, 0, 0, 48], "64 x 48 pixels");
        }
        let count = fs::read_dir(folder.path().join("frames").join(name)).unwrap().count();
        assert_eq!(count, episode.steps.len());
    }
    // The log contains the whole trace.
    succeeds(program(folder.path()).args(["trace", "recover", "again.mcap", "-o", "again.parquet"]));
    let again = fs::read(folder.path().join("again.parquet")).unwrap();
    assert!(again == fs::read(recorded("E1")).unwrap(), "the trace of the log has other bytes");
}

#[cfg(unix)]
#[test]
fn the_log_that_is_there_stays_if_the_new_one_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("again.mcap");
    let replay = |blocks: &str| {
        let mut command = limited(folder.path(), &format!("trap '' XFSZ; ulimit -f {blocks}"));
        command.args(["world", "replay"]).arg(recorded("E1")).args(["--mcap", "again.mcap"]).output().unwrap()
    };
    need::drawing();
    let output = replay("unlimited");
    assert!(output.status.success(), "{}", stderr(&output));
    let whole = fs::read(&log).unwrap();
    // The limit on file sizes simulates a full disk: each episode fits, all of them do not.
    let output = replay(&(whole.len() * 4 / 5 / 512).to_string());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("cannot write the log `again.mcap`"), "{}", stderr(&output));
    assert!(fs::read(&log).unwrap() == whole);
    // An existing log is replaced, not extended.
    assert!(replay("unlimited").status.success());
    assert!(fs::read(&log).unwrap() == whole);
}

#[test]
fn a_film_strip_is_the_same_from_the_log_and_from_the_trace() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("small.toml"), "eye.width = 64\neye.height_px = 48\nepisode.steps = 40\n").unwrap();
    let words = "record --config small.toml --out runs --agent random --experiment E3 --seeds 1 --runs 2";
    need::drawing();
    succeeds(&mut typed(folder.path(), words));
    let drawn = |source: &str, name: &str, more: &[&str]| {
        let mut command = program(folder.path());
        command.args(["world", "filmstrip", "E3/random/s1/r2", source, "--out", name]).args(more);
        succeeds(&mut command);
        fs::read(folder.path().join(name)).unwrap()
    };
    for (ending, more) in [("svg", &[][..]), ("png", &["--steps", "1,2,3"]), ("pdf", &["--steps", "1,2"])] {
        let [log, trace] =
            ["mcap", "parquet"].map(|from| drawn(&format!("runs/E3-random.{from}"), &format!("{from}.{ending}"), more));
        assert!(log == trace, "the .{ending} of the log and of the trace");
        assert!(log == drawn("runs", &format!("folder.{ending}"), more));
    }
}

/// The film strip of the bundled log's episode.
fn strip(folder: &Path, more: &[&str]) -> String {
    let mut command = program(folder);
    command.args(["world", "filmstrip", "E1/guesser/s1/r1"]).arg(fixture("recorded/E1-guesser.mcap"));
    succeeds(command.args(["--out", "strip.svg"]).args(more));
    fs::read_to_string(folder.join("strip.svg")).unwrap()
}

#[test]
fn a_film_strip_tells_the_story_of_its_episode() {
    let folder = tempfile::tempdir().unwrap();
    let bundled = episodes(&fixture("recorded/E1-guesser.parquet"));
    let episode = bundled.iter().find(|episode| episode.episode_id == "E1/guesser/s1/r1").unwrap();
    let svg = strip(folder.path(), &[]);
    assert_eq!(svg.matches("<image").count(), 6.min(episode.steps.len()));
    let last = episode.steps.last().unwrap();
    let takes = format!("t = {}: done, takes {}", episode.steps.len(), last.selected_cube.as_deref().unwrap());
    for words in [
        &format!("E1/guesser/s1/r1: body {}", episode.body_color),
        &takes,
        &format!("claims {}", last.self_color.as_deref().unwrap()),
        "first claim",
        "decision",
    ] {
        assert!(svg.contains(words), "{words}");
    }
    let svg = strip(folder.path(), &["--steps", "2,1"]);
    assert_eq!(svg.matches("<image").count(), 2);
}

#[test]
fn an_impossible_film_strip_is_refused_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let log = fixture("recorded/E1-guesser.mcap").display().to_string();
    let last = episodes(&fixture("recorded/E1-guesser.parquet"))[0].steps.len();
    let beyond = (last + 1).to_string();
    for (episode, source, words, expected) in [
        ("E1/guesser/s9/r9", log.as_str(), &["--out", "a.svg"][..], "has the episode `E1/guesser/s9/r9`"),
        ("E1/guesser/s1/r1", &log, &["--out", "a.gif"], "ends in .png, .svg or .pdf"),
        ("E1/guesser/s1/r1", &log, &["--out", "a"], "ends in .png, .svg or .pdf"),
        ("E1/guesser/s1/r1", &log, &["--out", "a.svg", "--steps", &beyond], "has steps 1 to "),
        ("E1/guesser/s1/r1", &log, &["--out", "a.svg", "--steps", "0"], "has steps 1 to "),
        ("E1/guesser/s1/r1", &log, &["--out", "none/a.svg"], "none/a.svg"),
        ("E1/guesser/s1/r1", "none.mcap", &["--out", "a.svg"], "none.mcap"),
    ] {
        let output = program(folder.path()).args(["world", "filmstrip", episode, source]).args(words).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{words:?}");
        assert!(stderr(&output).contains(expected), "{words:?}: {}", stderr(&output));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{words:?}");
    }
}
