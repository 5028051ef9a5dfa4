//! The traces of complete experiments can be read while a recording runs.

use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::recordings::{Bench, seed_of, three_steps};
use crate::harness::files::{assert_same, contents};
use crate::harness::program::{program, run, stderr};

/// `record` of E1 and E2 with logs, one episode at a time.
fn record(bench: &Bench) -> Command {
    let mut command = program(bench.folder.path());
    command.args(["record", "--config", "small.toml", "--seeds", "1", "--runs", "2", "--experiment", "E1,E2"]);
    command.args(["--threads", "1", "--agent", "exec:sh program.sh", "--out", "runs"]);
    command
}

#[test]
fn a_complete_experiment_appears_before_the_others() {
    let bench = Bench::new();
    // The second episode of E1 is lost. E2 waits for the file `go`.
    let [gone, third, fourth] = [(1, 2), (2, 1), (2, 2)].map(|(experiment, run)| seed_of(experiment, run));
    let lost = format!(
        "case \"$line\" in *'{gone}'*) exit 3 ;; *'{third}'*|*'{fourth}'*) while ! [ -e go ]; do sleep 0.02; done ;; esac"
    );
    bench.program(&three_steps());
    let script = fs::read_to_string(bench.path("program.sh")).unwrap();
    fs::write(bench.path("program.sh"), script.replacen("do\n", &format!("do\n  {lost}\n"), 1)).unwrap();
    let child = record(&bench).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let trace = bench.path("runs/E1-exec.parquet");
    let start = Instant::now();
    while !trace.exists() && start.elapsed() < Duration::from_mins(2) {
        sleep(Duration::from_millis(20));
    }
    let report = run(bench.folder.path(), &["report", "runs", "--out", "report"]).done();
    let listed: Vec<_> = bench.lost().iter().map(|lost| lost["episode_id"].clone()).collect();
    let is_there = trace.exists() && !bench.path("runs/E2-exec.parquet").exists();
    fs::write(bench.path("go"), "").unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(is_there && report.contains("exec"), "{report}");
    assert_eq!(listed, ["E1/exec/s1/r2"]);
    let rows = |experiment: &str| bench.texts(&format!("runs/{experiment}-exec.parquet"), "episode_id").len();
    assert_eq!((rows("E1"), rows("E2"), bench.lost().len()), (3, 6, 1));
}

#[test]
fn experiments_recorded_together_or_one_by_one_give_the_same_bytes() {
    let bench = Bench::new();
    let record = |experiments: &str, out: &str| {
        let words = "record --config small.toml --seeds 2 --runs 2 --threads 2 --agent random --experiment";
        run(bench.folder.path(), &[&words.split(' ').collect::<Vec<_>>()[..], &[experiments, "--out", out]].concat())
            .done();
    };
    record("E1..E3", "together");
    for experiment in ["E3", "E1", "E2"] {
        record(experiment, "apart");
    }
    let [one, other] = ["together", "apart"].map(|folder| contents(&bench.path(folder)));
    assert_eq!(one.len(), 6);
    assert_same(&one, &other);
}
