//! A recording that goes on, looked at.

use std::process::Stdio;

use crate::harness::files::write_small_world;
use crate::harness::need;
use crate::harness::program::{Running, program, wait_for};
use crate::html::browser::Browser;
use crate::view::Server;
use crate::view::pages::until;

/// An agent that turns, and thinks for so many seconds each time.
const AGENT: &str = r#"exec:python3 -u -c 'import sys, time, json
for line in sys.stdin:
    if json.loads(line)["kind"] == "observation":
        time.sleep(PAUSE)
        print(json.dumps({"view-description": "", "reasoning": "", "action": "a", "summary": "", "selected_cube": "none", "identification": "unknown"}))'"#;

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
    // Slow enough for a browser that starts meanwhile.
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
    // Stopping and starting again does not disturb the page; what was not whole is recorded anew.
    let _ = recording.0.kill();
    let _ = recording.0.wait();
    let mut again = record("0.05");
    assert!(again.0.wait().unwrap().success());
    until(&mut browser, "document.querySelectorAll('.metric').length > 0");
    assert_eq!(browser.value(length), 25);
    assert_eq!(server.get("/api/live").json()["running"], serde_json::json!([]));
    browser.close();
}
