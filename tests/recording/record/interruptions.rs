//! An interrupted recording: whole episodes are kept, and the same command continues to the same bytes.

use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;

use super::recordings::Bench;
use crate::harness::files::assert_same;
use crate::harness::program::{interrupt, limited, run, stderr, succeeds};

const WORDS: &str = "--agent random --experiment E1,E5 --seeds 2 --runs 4 --threads 1";

/// Waits until there are `count` parts, or the recording has ended.
fn wait_for_parts(bench: &Bench, child: &mut Child, count: usize) {
    while bench.parts("cut") < count && child.try_wait().unwrap().is_none() {
        sleep(Duration::from_millis(1));
    }
}

#[test]
fn a_recording_killed_at_any_moment_continues() {
    let bench = Bench::new();
    let whole = bench.recorded("whole", WORDS);
    let mut killed = 0;
    // A moment is a number of finished episodes and some milliseconds of the next one.
    for (parts, ms) in [(0, 0), (0, 35), (1, 0), (2, 3), (3, 11), (5, 19), (7, 7), (11, 1), (14, 0), (15, 2), (16, 4)] {
        let mut child = bench.record("cut", WORDS).stderr(Stdio::null()).spawn().unwrap();
        wait_for_parts(&bench, &mut child, parts);
        sleep(Duration::from_millis(ms));
        killed += usize::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert!(killed >= 5, "the recording ended before it could be killed, all but {killed} times");
    assert_same(&bench.recorded("cut", WORDS), &whole);
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_at_whole_episodes_and_says_how_to_go_on() {
    let bench = Bench::new();
    let whole = bench.recorded("whole", WORDS);
    let mut child = bench.record("cut", &format!("{WORDS} --json"));
    let mut child = child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for_parts(&bench, &mut child, 2);
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert!(stderr(&output).contains("the same command continues"), "{}", stderr(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["stopped"], true);
    let recorded = answer["recorded"].as_u64().unwrap();
    assert!((2..16).contains(&recorded), "{answer}");
    // It leaves a normal recording: whole episodes in a trace, and no files besides traces and logs.
    assert!(bench.files("cut").keys().all(|name| !name.starts_with('.')));
    let checked = run(bench.folder.path(), &["trace", "validate", "--json", "cut"]).json();
    let episodes: u64 =
        checked["files"].as_array().unwrap().iter().map(|file| file["episodes"].as_u64().unwrap()).sum();
    assert_eq!(episodes, recorded);

    let again = succeeds(&mut bench.record("cut", &format!("{WORDS} --json")));
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!((again["found"].as_u64(), again["recorded"].as_u64()), (Some(recorded), Some(16 - recorded)));
    assert_same(&bench.files("cut"), &whole);
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_reported_and_loses_no_recorded_episode() {
    let bench = Bench::new();
    let before = bench.recorded("runs", "--agent random --experiment E1 --seeds 1 --runs 1");
    // A limit on file sizes simulates a full disk: writes begin to fail in the middle of a file.
    let within = |blocks: u32| {
        let words =
            "record --config small.toml --out runs --agent random --experiment E1 --seeds 1 --runs 3 --no-frames";
        let mut command = limited(bench.folder.path(), &format!("trap '' XFSZ; ulimit -f {blocks}"));
        command.args(words.split(' ')).output().unwrap()
    };
    for blocks in [1, 8] {
        let output = within(blocks);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).starts_with("error: cannot write"), "{}", stderr(&output));
        assert!(stderr(&output).contains("the disk not full?"), "{}", stderr(&output));
        assert_eq!(stderr(&output).matches("error: ").count(), 1, "{}", stderr(&output));
        assert_same(&bench.files("runs"), &before);
    }
    let whole = bench.recorded("whole", "--agent random --experiment E1 --seeds 1 --runs 3");
    assert_same(&bench.recorded("runs", "--agent random --experiment E1 --seeds 1 --runs 3"), &whole);
}

#[test]
fn files_of_a_killed_recording_are_removed() {
    let bench = Bench::new();
    let whole = bench.recorded("runs", "--agent random --experiment E1 --seeds 1 --runs 1");
    let parts = bench.path("runs").join(".parts");
    std::fs::create_dir(&parts).unwrap();
    for name in [".mirrorstats-abc", "E1-random-s1-r2.mcap"] {
        std::fs::write(parts.join(name), "half of somethi").unwrap();
    }
    assert_same(&bench.recorded("runs", "--agent random --experiment E1 --seeds 1 --runs 1"), &whole);
}
