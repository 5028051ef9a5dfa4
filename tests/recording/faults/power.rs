//! The power fails during a recording: recorded episodes are kept, and the same command continues to the same bytes.

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

use super::{Round, check_all, sample};
use crate::harness::faults::{Call, calls, watched};
use crate::harness::files::{Contents, contents, write_small_world};
use crate::harness::power::{Disk, Unsynced};
use crate::harness::program::{program, stderr, succeeds};

fn record(home: &Path) -> Command {
    let mut command = program(home);
    command.args("record --config small.toml --agent random --experiment E1 --seeds 1 --runs 2".split(' '));
    command.args("--no-frames --threads 1 --json --out deep/runs".split(' '));
    command
}

/// The number of episodes on disk after these calls: parts with synchronised names.
fn kept(calls: &[Call]) -> usize {
    let (mut named, mut kept) = (0, 0);
    for call in calls {
        match call {
            Call::Rename(_, to) => {
                let is_part = to.parent().is_some_and(|folder| folder.ends_with(".parts"));
                named += usize::from(is_part && to.extension().is_some_and(|ending| ending == "parquet"));
            }
            Call::SyncFolder(folder) if folder.ends_with(".parts") => kept = named,
            _ => {}
        }
    }
    kept
}

struct Case {
    round: Round,
    whole: Contents,
    calls: Vec<Call>,
}

impl Case {
    fn new() -> Self {
        let empty = tempfile::tempdir().unwrap();
        write_small_world(empty.path(), "episode.steps = 20\n");
        let round = Round::new(empty.path());
        succeeds(watched(&mut record(&round.home()), &round.home(), &round.log()));
        let whole = contents(&round.home().join("deep/runs"));
        assert_eq!(whole.len(), 2);
        let calls = calls(&round.log());
        Self { round, whole, calls }
    }

    /// Fails the power after `count` calls.
    fn check(&self, count: usize, unsynced: Unsynced) {
        let told = format!("after {count} of {} calls, unsynced {unsynced:?}", self.calls.len());
        let home = tempfile::tempdir().unwrap();
        write_small_world(home.path(), "episode.steps = 20\n");
        let calls = &self.calls[..count];
        Disk::after(calls).restore(unsynced, &self.round.home().canonicalize().unwrap(), home.path());
        let runs = home.path().join("deep/runs");
        if count == self.calls.len() {
            let found = contents(&runs);
            let is_there = |(name, bytes): (&String, &Vec<u8>)| found.get(name) == Some(bytes);
            assert!(
                self.whole.iter().all(is_there),
                "{told}: a recording that has ended is on the disk: {:?}",
                found.keys()
            );
        }
        let output = record(home.path()).stdin(Stdio::null()).output().unwrap();
        assert!(output.status.success(), "{told}: {}", stderr(&output));
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(answer["found"].as_u64().unwrap() >= kept(calls) as u64, "{told}: an episode was lost: {answer}");
        let found = contents(&runs);
        assert_eq!(found.keys().collect::<Vec<_>>(), self.whole.keys().collect::<Vec<_>>(), "{told}");
        assert!(found == self.whole, "{told}: other bytes");
    }
}

fn check(most: usize, seeds: u64) {
    let case = Case::new();
    let changes = |at: &usize| !matches!(case.calls[at - 1], Call::Open(_));
    let mut points = Vec::new();
    for at in (1..=case.calls.len()).filter(changes) {
        points.extend([(at, Unsynced::Gone), (at, Unsynced::Names)]);
        points.extend((0..seeds).map(|seed| (at, Unsynced::Some(seed * 10_000 + at as u64))));
    }
    println!("{} losses of power in a recording of {} calls", points.len(), case.calls.len());
    sample(&mut points, most);
    points.extend([(case.calls.len(), Unsynced::Gone), (case.calls.len(), Unsynced::Some(1))]);
    check_all(&points, |(count, unsynced)| case.check(*count, *unsynced));
}

#[test]
fn a_recording_goes_on_after_a_loss_of_power() {
    check(100, 2);
}

#[test]
#[ignore = "soak: a loss of power after every call, each in ten ways"]
fn soak_a_recording_goes_on_after_a_loss_of_power() {
    check(usize::MAX, 8);
}
