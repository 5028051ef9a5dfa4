//! A folder has one recorder at a time; shares of a recording go into folders of their own.

use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

use super::recordings::Bench;
use crate::harness::files::{assert_same, write_small_world};
use crate::harness::program::{program, run, stderr, succeeds};

const WORDS: &str = "--agent random --experiment E1,E5 --seeds 1 --runs 2 --threads 1";

fn bench() -> Bench {
    let bench = Bench::new();
    write_small_world(bench.folder.path(), "episode.steps = 40\n");
    bench
}

/// A study of the same agent, with a recording per condition in one folder or in several.
fn study(bench: &Bench, text: &str) {
    let all =
        "agent = \"random\"\nconfig = \"small.toml\"\nexperiment = \"E1\"\nseeds = 1\nruns = 1\nno-frames = true\n";
    std::fs::write(bench.path("study.toml"), format!("{all}[model.random]\n{text}")).unwrap();
    let mut command = program(bench.folder.path());
    succeeds(command.args(["record", "study.toml", "--json"]));
}

#[test]
fn a_second_recorder_is_refused_at_once_and_a_killed_one_blocks_nobody() {
    let bench = bench();
    let whole = bench.recorded("whole", WORDS);
    let mut first = bench.record("runs", WORDS).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !bench.path("runs/.parts").exists() {
        sleep(Duration::from_millis(1));
    }
    // The first one stands still, so that it cannot end before the second one has come.
    let signal = |name: &str| {
        let sent = std::process::Command::new("kill").args([name, &first.id().to_string()]).status();
        assert!(sent.unwrap().success());
    };
    signal("-STOP");
    let refused = bench.record("runs", WORDS).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    let said = stderr(&refused);
    assert!(said.starts_with("error: another process records into `runs`\n  help: "), "{said}");
    for way in ["--out", "--shard", "`record study.toml`"] {
        assert!(said.contains(way), "{said}");
    }
    // A forecast only reads.
    succeeds(&mut bench.record("runs", &format!("{WORDS} --dry-run")));
    signal("-KILL");
    first.wait().unwrap();
    assert_same(&bench.recorded("runs", WORDS), &whole);
}

#[test]
fn shares_in_several_folders_have_the_scores_of_one() {
    let bench = bench();
    bench.recorded("whole", WORDS);
    let start = |share: u32| {
        let mut command = bench.record(&format!("share-{share}"), &format!("{WORDS} --shard {share}/2"));
        command.stderr(Stdio::null()).spawn().unwrap()
    };
    for mut child in [1, 2].map(start) {
        assert!(child.wait().unwrap().success());
    }
    let scored = |folders: &[&str]| run(bench.folder.path(), &[&["score"], folders].concat()).done();
    assert_eq!(scored(&["share-1", "share-2"]), scored(&["whole"]));
}

#[test]
fn the_recordings_of_a_study_share_a_folder_or_have_their_own() {
    let bench = bench();
    study(&bench, "[condition.one]\n[condition.two]\n");
    assert!(bench.path("runs/E1-random@one.parquet").is_file() && bench.path("runs/E1-random@two.parquet").is_file());
    study(&bench, "[condition.one]\nout = \"first\"\n[condition.two]\nout = \"second\"\n");
    let same = |own: &str, condition: &str| {
        let name = format!("E1-random@{condition}.parquet");
        assert!(std::fs::read(bench.path(own).join(&name)).unwrap() == bench.files("runs")[&name]);
    };
    same("first", "one");
    same("second", "two");
}
