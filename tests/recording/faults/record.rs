//! Every call of a recording fails once: whole episodes are kept, and the same command continues to the same bytes.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

use super::{Round, check_all, check_words, faults, sample};
use crate::harness::faults::{Call, Fault, calls, failing, watched};
use crate::harness::files::{Contents, assert_same, contents, write_small_world};
use crate::harness::program::{program, stderr, succeeds};
use crate::harness::traces;

/// A lost episode of another model, and one that this recording makes up for.
const LOST: &str = r#"{"episode_id":"E1/other/s1/r1","model":"other","experiment":"E1","seed":1,"run":1,"step":2,"status":"timeout","reason":"slow"}
{"episode_id":"E1/random/s1/r2","model":"random","experiment":"E1","seed":1,"run":2,"step":2,"status":"timeout","reason":"slow"}
"#;

fn record(home: &Path, runs: u32) -> Command {
    let mut command = program(home);
    command
        .args("record --config small.toml --agent random --experiment E1 --seeds 1 --no-frames --threads 1".split(' '));
    command.args(["--out", "runs", "--runs", &runs.to_string()]);
    command
}

/// A recording with one episode of two, and its complete form.
struct Case {
    home: TempDir,
    whole: Contents,
    calls: Vec<Call>,
}

fn ids(home: &Path) -> BTreeSet<String> {
    let episodes = traces::episodes(&home.join("runs/E1-random.parquet"));
    let ids: BTreeSet<String> = episodes.iter().map(|episode| episode.episode_id.clone()).collect();
    assert_eq!(ids.len(), episodes.len(), "each is there once");
    ids
}

impl Case {
    fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        write_small_world(home.path(), "episode.steps = 20\n");
        succeeds(&mut record(home.path(), 1));
        fs::write(home.path().join("runs/lost.jsonl"), LOST).unwrap();
        let round = Round::new(home.path());
        succeeds(watched(&mut record(&round.home(), 2), &round.home(), &round.log()));
        let whole = contents(&round.home().join("runs"));
        assert_eq!(whole.keys().collect::<Vec<_>>(), ["E1-random.mcap", "E1-random.parquet", "lost.jsonl"]);
        Self { home, whole, calls: calls(&round.log()) }
    }

    fn check(&self, fault: Fault) {
        let round = Round::new(self.home.path());
        let (home, log) = (round.home(), round.log());
        let output = failing(&mut record(&home, 2), &home, &log, fault).output().unwrap();
        let told = || format!("{fault}: {:?}\n{}", output.status, stderr(&output));
        let ids = ids(&home);
        assert!(ids.contains("E1/random/s1/r1") && ids.len() <= 2, "{}", told());
        let lost = fs::read_to_string(home.join("runs/lost.jsonl")).unwrap();
        assert!(lost == LOST || lost.as_bytes() == self.whole["lost.jsonl"], "{}: {lost}", told());
        if fault.error != 0 {
            let mut found = contents(&home.join("runs"));
            // Ignore locks that could not be removed and leftovers.
            found.retain(|name, _| !name.starts_with('.'));
            let names = ["E1-random.parquet", "E1-random.mcap", "lost.jsonl", "runs"];
            check_words(&output, fault, found == self.whole, &calls(&log), &names)
                .unwrap_or_else(|words| panic!("{}: {words}", told()));
        }
        let again = record(&home, 2).output().unwrap();
        assert!(again.status.success(), "{}: again: {}", told(), stderr(&again));
        let found = contents(&home.join("runs"));
        assert_eq!(found.keys().collect::<Vec<_>>(), self.whole.keys().collect::<Vec<_>>(), "{}", told());
        assert_same(&found, &self.whole);
    }
}

fn check(most: usize) {
    let case = Case::new();
    let mut faults = faults(&case.calls);
    println!("{} faults in a recording", faults.len());
    sample(&mut faults, most);
    check_all(&faults, |fault| case.check(*fault));
}

#[test]
fn a_recording_continues_after_any_failed_call() {
    check(60);
}

#[test]
#[ignore = "soak: every call of a recording with every error"]
fn soak_a_recording_continues_after_any_failed_call() {
    check(usize::MAX);
}
