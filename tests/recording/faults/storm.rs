//! Processes that record into one folder or read it, killed at any moment. One at a time records and others are refused;
//! the folder never gets stuck, no episode is lost, and readers see a complete state or say what is missing.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::{check_all, copy};
use crate::harness::faults::{Draws, rounds};
use crate::harness::files::{Contents, assert_same, contents, write_small_world};
use crate::harness::program::{program, stderr, succeeds, typed};

const EPISODES: u32 = 2;
/// Longer than any round on any machine; a process that takes longer is stuck.
const STUCK: Duration = Duration::from_mins(3);

fn record(home: &Path) -> Command {
    let mut command = program(home);
    command.args(
        "record --config small.toml --agent random --experiment E1 --seeds 1 --no-log --no-frames --threads 1"
            .split(' '),
    );
    command.args(["--out", "runs", "--runs", &EPISODES.to_string()]);
    command
}

/// A process of a round.
struct Started {
    child: Child,
    reads: bool,
    /// True if it runs until it is killed.
    serves: bool,
}

/// Starts a process that records or, one time in three, reads.
fn start(home: &Path, at: usize, draws: &mut Draws) -> Started {
    let reads = at > 0 && draws.below(3) == 0;
    let mut serves = false;
    let mut command = if reads {
        let words = [
            format!("score runs -o s{at}.csv"),
            format!("report runs --no-figures --out r{at}"),
            "trace info runs".to_owned(),
            "view runs --no-open --port 0".to_owned(),
        ];
        let which = draws.below(if cfg!(feature = "view") { 4 } else { 3 });
        serves = which == 3;
        typed(home, &words[which])
    } else {
        record(home)
    };
    let said = fs::File::create(home.join(format!("said{at}"))).unwrap();
    Started { child: command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(said).spawn().unwrap(), reads, serves }
}

/// Waits for a process that must end.
#[track_caller]
fn ended(child: &mut Child, told: &str) -> i32 {
    let begin = Instant::now();
    loop {
        match child.try_wait().unwrap() {
            Some(status) => return status.code().unwrap_or(-1),
            None if begin.elapsed() > STUCK => {
                child.kill().unwrap();
                panic!("{told}: stuck");
            }
            None => sleep(Duration::from_millis(2)),
        }
    }
}

struct Bench {
    empty: tempfile::TempDir,
    whole: Contents,
    scores: Vec<String>,
}

fn lines(path: &Path) -> Vec<String> {
    fs::read_to_string(path).unwrap().lines().map(str::to_owned).collect()
}

impl Bench {
    fn new() -> Self {
        let [empty, full] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        write_small_world(empty.path(), "episode.steps = 12\n");
        copy(empty.path(), full.path());
        succeeds(&mut record(full.path()));
        succeeds(&mut typed(full.path(), "score runs -o s.csv"));
        let (whole, scores) = (contents(&full.path().join("runs")), lines(&full.path().join("s.csv")));
        assert_eq!(scores.len(), 1 + EPISODES as usize);
        Self { empty, whole, scores }
    }

    fn round(&self, seed: usize) {
        let home = tempfile::tempdir().unwrap();
        let home = home.path();
        copy(self.empty.path(), home);
        let mut draws = Draws::new(seed as u64);
        // 2 to 8 processes, more often few than many.
        let count = 2 + draws.below(3) + if draws.below(8) == 0 { draws.below(5) } else { 0 };
        let mut processes: Vec<Started> = Vec::new();
        for at in 0..count {
            processes.push(start(home, at, &mut draws));
            sleep(Duration::from_millis(draws.below(40) as u64));
        }
        // Two of three processes are killed after a while, and all servers.
        for process in &mut processes {
            if draws.below(3) > 0 || process.serves {
                sleep(Duration::from_millis(draws.below(50) as u64));
                let _ = process.child.kill();
            }
        }
        for (at, process) in processes.iter_mut().enumerate() {
            let code = ended(&mut process.child, &format!("round {seed}, process {at}"));
            let said = fs::read_to_string(home.join(format!("said{at}"))).unwrap();
            self.check(home, seed, at, process.reads, code, &said);
        }
        let output = record(home).output().unwrap();
        assert!(output.status.success(), "round {seed}: {}", stderr(&output));
        assert_same(&contents(&home.join("runs")), &self.whole);
    }

    /// Checks the result of a process that ended or was killed.
    fn check(&self, home: &Path, seed: usize, at: usize, reads: bool, code: i32, said: &str) {
        let told = format!("round {seed}, process {at}: {code}: {said}");
        assert!(!said.contains("panicked"), "{told}");
        match (code, reads) {
            (-1 | 0, _) => {}
            (2, false) => assert!(said.starts_with("error: another process records into `runs`"), "{told}"),
            // There is no recording yet, or listed files have been replaced meanwhile.
            (2, true) => assert!(said.contains("error: ") && !said.contains("damaged"), "{told}"),
            _ => panic!("{told}"),
        }
        let scores = home.join(format!("s{at}.csv"));
        if scores.exists() {
            let found = lines(&scores);
            assert!(found.len() > 1 && found.iter().all(|line| self.scores.contains(line)), "{told}: {found:?}");
            let mut distinct = found.clone();
            distinct.dedup();
            assert_eq!(distinct, found, "{told}");
        }
        let report = home.join(format!("r{at}"));
        assert!(!report.exists() || report.join("manifest.json").is_file(), "{told}");
    }
}

fn check(count: usize) {
    let bench = Bench::new();
    let seeds: Vec<usize> = (0..count).collect();
    check_all(&seeds, |seed| bench.round(*seed));
    println!("{count} rounds");
}

#[test]
fn killed_processes_sharing_a_folder_lose_no_episode() {
    check(100);
}

#[test]
#[ignore = "soak: ROUNDS rounds, 10000 if nothing is said"]
fn soak_killed_processes_sharing_a_folder_lose_no_episode() {
    check(rounds("ROUNDS", 10_000));
}
