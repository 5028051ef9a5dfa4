//! Viewing a recording in progress.

use std::path::Path;
use std::process::Stdio;

use crate::harness::files::{fixture, write_small_world};
use crate::harness::need;
use crate::harness::program::{Running, program, run, wait_for};
use crate::html::browser::Browser;
use crate::view::Server;
use crate::view::pages::until;

/// An agent that turns, and thinks for this many seconds each time.
const AGENT: &str = r#"exec:python3 -u -c 'import sys, time, json
for line in sys.stdin:
    if json.loads(line)["kind"] == "observation":
        time.sleep(PAUSE)
        print(json.dumps({"view-description": "", "reasoning": "", "action": "a", "summary": "", "selected_cube": "none", "identification": "unknown"}))'"#;

/// An agent that turns, and waits before each step until the file `allowed` has the step's number.
const WAITING: &str = r#"exec:python3 -u -c 'import sys, time, json
step = 0
for line in sys.stdin:
    if json.loads(line)["kind"] == "observation":
        step += 1
        while int(open("allowed").read() or 0) < step: time.sleep(0.02)
        print(json.dumps({"view-description": "", "reasoning": "", "action": "a", "summary": "", "selected_cube": "none", "identification": "unknown"}))'"#;

/// Lets the agent go on to a step. The rename ensures that the agent never reads half a number.
fn allow(folder: &Path, step: u32) {
    std::fs::write(folder.join("next"), step.to_string()).unwrap();
    std::fs::rename(folder.join("next"), folder.join("allowed")).unwrap();
}

#[test]
fn pages_that_are_open_grow_with_the_recording() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_small_world(here, "episode.steps = 25\n");
    let record = |runs: &str| {
        let mut command = program(here);
        command.args(["record", "--agent", WAITING, "--model", "turner", "--experiment", "E1", "--seeds", "1"]);
        command.args(["--runs", runs, "--out", "runs", "--config", "small.toml"]);
        Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    };
    allow(here, 25);
    assert!(record("1").0.wait().unwrap().success());
    let server = Server::start(here, &["runs"]);
    let mut list = Browser::at(&format!("{}?view=episodes", server.link));
    until(&mut list, "document.querySelectorAll('.list .rows a').length === 1");
    allow(here, 2);
    let mut recording = record("2");
    until(&mut list, "document.querySelector('#live').textContent.startsWith('1 under way')");
    let mut episode = Browser::at(&format!("{}?view=episode&id=E1/turner/s1/r2", server.link));
    let length = |steps: u32| format!("document.querySelector('#length')?.textContent === '{steps}'");
    until(&mut episode, &length(2));
    until(&mut episode, "document.querySelector('img.frame')?.naturalWidth > 0");
    assert!(episode.holds("document.querySelector('.state').textContent === 'under way'"));
    allow(here, 4);
    until(&mut episode, &length(4));
    until(&mut episode, "document.querySelector('.clock').textContent === 't = 4 of 4'");
    assert!(
        list.holds("document.querySelectorAll('.list .rows a').length === 1"),
        "an episode under way is not scored"
    );
    allow(here, 25);
    assert!(recording.0.wait().unwrap().success());
    until(&mut episode, &length(25));
    until(&mut episode, "document.querySelectorAll('.metric').length > 0");
    until(&mut list, "document.querySelectorAll('.list .rows a').length === 2");
    assert!(list.text("document.querySelector('#count').textContent").starts_with("2 episodes"));
    episode.close();
    list.close();
}

/// Copies of a recording that is replacing and removing its own files: each copy is consistent.
#[test]
fn a_copy_of_a_recording_that_goes_on_is_whole() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    write_small_world(here, "episode.steps = 25\n");
    let record = |runs: &str| {
        let mut command = program(here);
        command.args(["record", "--agent", "random", "--experiment", "E1", "--seeds", "1", "--no-frames"]);
        command.args(["--runs", runs, "--out", "runs", "--config", "small.toml"]);
        Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    };
    assert!(record("1").0.wait().unwrap().success());
    let mut recording = record("40");
    let mut copies = 0;
    while recording.0.try_wait().unwrap().is_none() || copies == 0 {
        run(here, &["view", "runs", "--export", "page"]).done();
        copies += 1;
        let data = here.join("page/data");
        let list = std::fs::read_to_string(data.join("list.js")).unwrap();
        let ids: Vec<usize> = list.match_indices("{\"id\":\"E1/").map(|(at, _)| at).collect();
        assert!(!ids.is_empty());
        for at in 0..ids.len() {
            assert!(data.join(format!("episode-{at}.js")).is_file(), "copy {copies}: episode {at} of {}", ids.len());
        }
        assert!(!data.join(format!("episode-{}.js", ids.len())).exists(), "copy {copies}");
    }
    println!("{copies} copies");
    let left = std::fs::read_dir(here).unwrap().count();
    assert_eq!(left, 3, "the world, the recording and the page");
}

#[test]
#[ignore = "soak: a recording in slow motion, looked at"]
fn soak_a_recording_appears_and_grows_and_ends() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    write_small_world(folder.path(), "episode.steps = 25\n");
    let record = |pause: &str| {
        let agent = AGENT.replace("PAUSE", pause);
        let mut command = program(folder.path());
        command.args(["record", "--agent", &agent, "--model", "turner", "--experiment", "E1", "--seeds", "1"]);
        command
            .args(["--runs", "1", "--out", "runs", "--config", "small.toml"])
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        Running(command.spawn().unwrap())
    };
    // Slow enough for a browser to start meanwhile.
    let mut recording = record("2");
    wait_for("a log that is being written", || {
        let parts = std::fs::read_dir(runs.join(".parts")).ok()?;
        parts
            .flatten()
            .any(|entry| entry.metadata().is_ok_and(|data| data.is_file() && data.len() > 3_000))
            .then_some(())
    });
    let server = Server::start(folder.path(), &["runs"]);
    let mut browser = Browser::at(&server.link);
    until(&mut browser, "document.querySelector('#under-way a')");
    browser.click("#under-way a");
    until(&mut browser, "document.querySelector('img.frame')?.naturalWidth > 0");
    let length = "Number(document.querySelector('#length').textContent)";
    let before = browser.value(length).as_u64().unwrap();
    until(&mut browser, &format!("{length} > {before}"));
    // Restarting the recording does not disturb the page; incomplete episodes are recorded again.
    let _ = recording.0.kill();
    let _ = recording.0.wait();
    let mut again = record("0.05");
    assert!(again.0.wait().unwrap().success());
    until(&mut browser, "document.querySelectorAll('.metric').length > 0");
    assert_eq!(browser.value(length), 25);
    assert_eq!(server.get("/api/live").json()["running"], serde_json::json!([]));
    browser.close();
}

#[test]
fn frames_of_a_trace_without_a_log_are_rendered_again() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(fixture("recorded").join("E1-guesser.parquet"), folder.path().join("alone.parquet")).unwrap();
    let server = Server::start(folder.path(), &["alone.parquet"]);
    let told = server.get("/api/episode?id=E1/guesser/s1/r1").json();
    assert_eq!((&told["frames"], &told["rendered"], &told["log"]), (&true.into(), &true.into(), &false.into()));
    let last = told["length"].as_u64().unwrap();
    for t in [1, last] {
        let frame = server.get(&format!("/api/frame?id=E1/guesser/s1/r1&t={t}"));
        assert!(frame.status == 200 && frame.body.starts_with(b"\x89PNG"), "{t}: {}", frame.status);
    }
    assert_eq!(server.get(&format!("/api/frame?id=E1/guesser/s1/r1&t={}", last + 1)).status, 404);
    let mut browser = Browser::at(&format!("{}?view=episode&id=E1/guesser/s1/r1", server.link));
    until(&mut browser, "document.querySelector('img.frame')?.naturalWidth > 0");
    assert!(browser.text("document.querySelector('.sight figcaption').textContent").starts_with("Rendered again"));
    browser.close();
}
