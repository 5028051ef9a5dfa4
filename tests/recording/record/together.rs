//! Several processes make the same recording: they divide the episodes, and take over from killed ones.

use std::fs;
use std::io::{BufRead as _, BufReader, Read as _};
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;
use world::record::lock::{Attempt, EpisodeLock, FolderLock};

use super::recordings::Bench;
use crate::harness::files::{Contents, assert_same, write_small_world};
use crate::harness::program::{interrupt, stderr, succeeds};

const EPISODES: u64 = 4;
const WORDS: &str = "--agent random --experiment E1,E5 --seeds 1 --runs 2 --threads 1";

fn bench() -> Bench {
    let bench = Bench::new();
    write_small_world(bench.folder.path(), "episode.steps = 40\n");
    bench
}

fn started(bench: &Bench, out: &str, count: usize) -> Vec<Child> {
    let start = |_| {
        let mut command = bench.record(out, &format!("{WORDS} --json"));
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    };
    (0..count).map(start).collect()
}

/// The answer of a successful recording.
fn answer(child: Child) -> Value {
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |key: &str| answer[key].as_u64().unwrap();
    assert_eq!(number("found") + number("recorded") + number("elsewhere"), EPISODES, "{answer}");
    answer
}

fn check_division(rounds: usize) {
    let bench = bench();
    let whole = bench.recorded("whole", WORDS);
    for round in 0..rounds {
        let out = format!("runs-{round}");
        let answers: Vec<Value> = started(&bench, &out, 2 + round % 2).into_iter().map(answer).collect();
        let recorded: u64 = answers.iter().map(|answer| answer["recorded"].as_u64().unwrap()).sum();
        assert_eq!(recorded, EPISODES, "each episode is played once: {answers:?}");
        assert_same(&bench.files(&out), &whole);
    }
}

#[test]
fn identical_commands_divide_the_episodes() {
    check_division(4);
}

#[test]
#[ignore = "soak: 24 rounds of 2 or 3 processes"]
fn soak_identical_commands_divide_the_episodes() {
    check_division(24);
}

/// A round that kills all processes but `stay`: one after some parts, the next one later. Returns the number killed.
fn killed(bench: &Bench, whole: &Contents, round: usize, stay: usize) -> usize {
    let out = format!("runs-{round}");
    let mut children = started(bench, &out, 2 + round % 2);
    let mut killed = 0;
    for (at, child) in children.iter_mut().enumerate().skip(stay) {
        while bench.parts(&out) < (round + at) % 3 && child.try_wait().unwrap().is_none() {
            sleep(Duration::from_millis(1));
        }
        sleep(Duration::from_millis((round * 7 % 13) as u64));
        killed += usize::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
    }
    for child in children.into_iter().take(stay) {
        answer(child);
    }
    // A surviving process records what the others left; without survivors, the same command does. It then also removes
    // the files of processes that were killed while others were running.
    succeeds(&mut bench.record(&out, WORDS));
    assert_same(&bench.files(&out), whole);
    killed
}

/// Rounds that each leave `stay` processes running; at least `least` processes must be killed before they end.
fn check_killed(rounds: usize, stay: usize, least: usize) {
    let bench = bench();
    let whole = bench.recorded("whole", WORDS);
    let killed: usize = (0..rounds).map(|round| killed(&bench, &whole, round, stay)).sum();
    assert!(killed >= least, "all but {killed} had ended before they could be killed");
}

#[test]
fn a_survivor_records_the_episodes_of_killed_processes() {
    check_killed(3, 1, 1);
}

#[test]
#[ignore = "soak: 10 rounds of 2 or 3 processes"]
fn soak_a_survivor_records_the_episodes_of_killed_processes() {
    check_killed(10, 1, 4);
}

#[test]
fn after_all_are_killed_the_same_command_goes_on() {
    check_killed(3, 0, 2);
}

#[test]
#[ignore = "soak: 10 rounds of 2 or 3 processes"]
fn soak_after_all_are_killed_the_same_command_goes_on() {
    check_killed(10, 0, 8);
}

/// The lock of E1's first episode, and a process that waits for it, with its output.
#[cfg(unix)]
fn waiting(bench: &Bench) -> (FolderLock, EpisodeLock, Child, String) {
    let claim = FolderLock::stake(&bench.path("runs")).unwrap();
    let Attempt::Ours(lock) = EpisodeLock::attempt(&claim.parts().join("E1-random-s1-r1.lock")).unwrap() else {
        panic!("nobody else has it")
    };
    let mut child = started(bench, "runs", 1).remove(0);
    let mut said = String::new();
    BufReader::with_capacity(1, child.stderr.as_mut().unwrap()).read_line(&mut said).unwrap();
    (claim, lock, child, said)
}

#[cfg(unix)]
#[test]
fn a_process_waits_for_an_episode_of_another_process() {
    let bench = bench();
    let whole = bench.recorded("whole", WORDS);
    let (claim, lock, child, said) = waiting(&bench);
    let process = std::process::id();
    let expected = format!("waiting for E1/random/s1/r1: process {process} records it into the same folder; ");
    assert!(said.starts_with(&expected), "{said}");
    // All other episodes are recorded: the other one of E1 is a part, and E5 is complete.
    assert_eq!(bench.parts("runs"), 1);
    assert!(fs::read(bench.path("runs/E5-random.parquet")).unwrap() == whole["E5-random.parquet"]);
    // Episodes that the other process leaves unrecorded are recorded here.
    drop(lock);
    assert_eq!(answer(child)["recorded"], EPISODES);
    drop(claim);
    assert_same(&bench.files("runs"), &whole);
}

#[cfg(unix)]
#[test]
fn waiting_can_be_ended() {
    let bench = bench();
    let whole = bench.recorded("whole", WORDS);
    let (claim, lock, mut child, _) = waiting(&bench);
    interrupt(&child);
    let mut said = String::new();
    child.stderr.as_mut().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{said}");
    assert!(said.contains("stopped, 1 episode to go: the same command continues"), "{said}");
    drop((lock, claim));
    let again = succeeds(&mut bench.record("runs", &format!("{WORDS} --json")));
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!((&again["found"], &again["recorded"]), (&3.into(), &1.into()));
    assert_same(&bench.files("runs"), &whole);
}

#[test]
fn overlapping_shards_give_the_same_bytes() {
    let bench = bench();
    let whole = bench.recorded("whole", WORDS);
    let shares = ["1/1", "1/2", "2/2", "2/3"];
    let start = |share: &str| {
        let mut command = bench.record("runs", &format!("{WORDS} --shard {share}"));
        command.stderr(Stdio::null()).spawn().unwrap()
    };
    for mut child in shares.map(start) {
        assert!(child.wait().unwrap().success());
    }
    assert_same(&bench.files("runs"), &whole);
}
