//! Programs as processes: one per episode, and none remains afterwards.

use std::fs;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::recordings::{Bench, outcome, three_steps};
use crate::harness::program::{interrupt, stderr, succeeds, wait_for};

/// Waits until a file has `count` lines and returns them.
fn lines(bench: &Bench, name: &str, count: usize) -> Vec<String> {
    wait_for(name, || {
        let text = fs::read_to_string(bench.path(name)).unwrap_or_default();
        let lines: Vec<String> = text.lines().map(str::to_owned).collect();
        (lines.len() >= count && text.ends_with('\n')).then_some(lines)
    })
}

/// Waits until every process with these ids is gone or a zombie; false if one is still running after a while.
fn are_gone(ids: &[String]) -> bool {
    let is_there = |id: &String| {
        let state = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        state.rsplit(") ").next().is_some_and(|rest| !rest.is_empty() && !rest.starts_with('Z'))
    };
    (0..400).any(|_| {
        let any = ids.iter().any(is_there);
        sleep(Duration::from_millis(if any { 10 } else { 0 }));
        !any
    })
}

#[test]
fn each_episode_has_a_process_of_its_own() {
    let bench = Bench::new();
    bench.program(&format!("echo $$ >> ids; {}", three_steps()));
    let words = ["--runs", "5", "--in-flight", "5", "--threads", "2"];
    let (code, answer, said) = outcome(&bench.record(&words).output().unwrap());
    assert_eq!((code, &answer["recorded"]), (Some(0), &5.into()), "{said}");
    let mut ids = lines(&bench, "ids", 15);
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), 5);
    assert!(are_gone(&ids));
}

#[test]
fn in_flight_limits_the_processes_at_once() {
    let bench = Bench::new();
    // A program that runs alone creates the folder; a second one at the same time finds it and fails.
    let lock = "[ $n = 1 ] && { mkdir alone || exit 9; }; [ $n = 3 ] && rmdir alone";
    bench.program(&format!("{lock}; {}", three_steps()));
    let words = ["--runs", "6", "--in-flight", "1", "--threads", "2"];
    let (code, answer, said) = outcome(&bench.record(&words).output().unwrap());
    assert_eq!((code, &answer["recorded"]), (Some(0), &6.into()), "{said}");
}

#[test]
fn children_of_a_program_end_with_it() {
    let bench = Bench::new();
    // The program ends normally, but its child would stay and keep its streams open.
    bench.program(&format!("[ $n = 1 ] && {{ sleep 600 & echo $! >> ids; }}; {}", three_steps()));
    let (code, _, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!(code, Some(0), "{said}");
    assert!(are_gone(&lines(&bench, "ids", 1)));
}

#[test]
#[cfg(target_os = "linux")]
fn children_in_another_process_group_end_too() {
    let bench = Bench::new();
    // A session of its own, with a parent that has ended.
    let daemon = "(setsid sh -c 'echo $$ >> ids; sleep 600' </dev/null >/dev/null 2>&1 &)";
    bench.program(&format!("[ $n = 1 ] && {daemon}; {}", three_steps()));
    let (code, _, said) = outcome(&bench.record(&[]).output().unwrap());
    assert_eq!(code, Some(0), "{said}");
    assert!(are_gone(&lines(&bench, "ids", 1)));
}

#[test]
fn ctrl_c_finishes_the_current_steps_and_a_second_one_stops_at_once() {
    let bench = Bench::new();
    for times in [1, 2] {
        let _ = fs::remove_file(bench.path("ids"));
        // Interrupted once, the program answers afterwards; interrupted twice, it never answers.
        let wait = if times == 1 { "while ! [ -e go ]; do sleep 0.01; done" } else { "sleep 600" };
        bench.program(&format!(
            "[ $n = 1 ] && {{ sleep 600 & echo $! $$ | tr ' ' '\\n' >> ids; }}; {wait}; {}",
            three_steps()
        ));
        let mut command = bench.record(&["--runs", "4", "--threads", "1"]);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let ids = lines(&bench, "ids", 2);
        for _ in 0..times {
            interrupt(&child);
            sleep(Duration::from_millis(100));
        }
        fs::write(bench.path("go"), "").unwrap();
        let output = child.wait_with_output().unwrap();
        let (code, _, said) = outcome(&output);
        assert_eq!(code, Some(130), "{said}");
        assert!(are_gone(&ids), "{times}: {said}");
        fs::remove_file(bench.path("go")).unwrap();
    }
    let ends: Vec<_> = bench.heard().into_iter().filter(|line| line["kind"] == "end").collect();
    assert_eq!((ends.len(), &ends[0]["reason"]), (1, &"stopped".into()));
}

/// Interrupts recordings twice while their renderer draws. The second interrupt ends each at once, with the exit code
/// of an interruption and without messages of the renderer's exit handlers.
fn check_twice(rounds: u64) {
    let bench = Bench::new();
    // Programs start before the first frame is drawn, and never answer.
    fs::write(bench.path("program.sh"), "echo $$ >> ids; sleep 600").unwrap();
    for round in 0..rounds {
        let _ = fs::remove_file(bench.path("ids"));
        let mut command = bench.record(&["--runs", "4", "--threads", "1", "--in-flight", "4"]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        lines(&bench, "ids", 1);
        sleep(Duration::from_millis(round % 10 * 4));
        let pause = ["0.003", "0.006", "0.009", "0.012"][usize::try_from(round % 4).unwrap()];
        let twice = ["-c", "kill -INT $0; sleep $1; kill -INT $0", &child.id().to_string(), pause];
        succeeds(Command::new("sh").args(twice));
        // The system merges two interrupts that arrive at the same moment.
        let begin = Instant::now();
        while child.try_wait().unwrap().is_none() {
            sleep(Duration::from_millis(30));
            interrupt(&child);
            assert!(begin.elapsed() < Duration::from_mins(1), "round {round}: a step that hangs is waited for");
        }
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "round {round}: {}: {}", output.status, stderr(&output));
        let ids: Vec<String> = fs::read_to_string(bench.path("ids")).unwrap().lines().map(str::to_owned).collect();
        assert!(are_gone(&ids), "round {round}");
        let _ = fs::remove_dir_all(bench.path("runs"));
    }
}

#[test]
fn a_second_ctrl_c_ends_a_recording_that_draws() {
    check_twice(12);
}

#[test]
#[ignore = "soak: 200 recordings, interrupted twice each"]
fn soak_a_second_ctrl_c_ends_a_recording_that_draws() {
    check_twice(200);
}

#[test]
fn frames_of_a_recording_that_was_killed_are_cleared_away() {
    let bench = Bench::new();
    // The program learns that the recording ended when its input ends.
    bench.program("echo $$ >> ids; cat > rest");
    let mut child = bench.record(&[]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let ids = lines(&bench, "ids", 1);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(are_gone(&ids));
    let frames = bench.heard()[1]["image"]["path"].as_str().unwrap().to_owned();
    assert!(fs::exists(&frames).unwrap());
    bench.program(&three_steps());
    assert_eq!(outcome(&bench.record(&[]).output().unwrap()).0, Some(0));
    assert!(!fs::exists(&frames).unwrap());
    assert_eq!(bench.leftovers(), Vec::<String>::new());
}
