//! A person in the agent's place: what they see, what they reply, and how it is recorded.

mod study;

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{ChildStderr, Command, Stdio};

use serde_json::{Value, json};

use crate::harness::need;
use crate::harness::program::{Running, program, run};
use crate::html::browser::Browser;
use crate::view::accessible::check;
use crate::view::pages::until;
use crate::view::{Response, ask};

/// A recording whose agents are people, and their links.
struct People {
    process: Running,
    links: Vec<String>,
    _rest: BufReader<ChildStderr>,
}

impl People {
    fn start(folder: &Path, codes: &str, more: &[&str]) -> Self {
        Self::start_in(folder, "E1", codes, more)
    }

    fn start_in(folder: &Path, experiment: &str, codes: &str, more: &[&str]) -> Self {
        Self::start_telling(folder, experiment, codes, more, Stdio::null())
    }

    fn start_telling(folder: &Path, experiment: &str, codes: &str, more: &[&str], answer: Stdio) -> Self {
        let mut command = program(folder);
        command.args(["record", "--agent", "human", "--model", "people", "--experiment", experiment, "--seeds", "1"]);
        command.args(["--out", "runs", "--human-port", "0", "--participants", codes]).args(more);
        Self::start_with(&mut command, codes.split(',').count(), answer)
    }

    fn start_with(command: &mut Command, people: usize, answer: Stdio) -> Self {
        let mut process = command.stdout(answer).stderr(Stdio::piped()).spawn().unwrap();
        let mut output = BufReader::new(process.stderr.take().unwrap());
        let mut links = Vec::new();
        while links.len() < people {
            let mut line = String::new();
            assert!(output.read_line(&mut line).unwrap() > 0, "the recording ended before it told its links");
            links.extend(line.trim().split_once(" plays at ").map(|(_, link)| link.to_owned()));
        }
        Self { process: Running(process), links, _rest: output }
    }

    fn person(&self, at: usize) -> Person {
        let link = &self.links[at];
        let port = link.split('/').nth(2).unwrap().rsplit_once(':').unwrap().1.parse().unwrap();
        let token = link.split_once("?p=").unwrap().1.to_owned();
        Person { port, token, heard: Vec::new() }
    }

    fn ends(mut self) {
        assert!(self.process.0.wait().unwrap().success());
    }
}

/// A person with a link, who remembers every received byte.
struct Person {
    port: u16,
    token: String,
    heard: Vec<u8>,
}

impl Person {
    fn ask(&mut self, method: &str, name: &str, body: &Value) -> Response {
        let (host, origin) = (format!("127.0.0.1:{}", self.port), format!("http://127.0.0.1:{}", self.port));
        let headers = [("Host", host.as_str()), ("Origin", origin.as_str())];
        let path = format!("/{name}?p={}", self.token);
        let answer = ask(self.port, method, &path, &headers, &body.to_string());
        self.heard.extend(answer.head.as_bytes());
        self.heard.extend(&answer.body);
        answer
    }

    /// Waits for one of these phases and returns the page's state.
    fn state(&mut self, phases: &[&str]) -> Value {
        loop {
            let told = self.ask("GET", "state", &Value::Null).json();
            if phases.iter().any(|phase| told["phase"] == **phase) {
                return told;
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    }

    /// Answers a question; begins the episode if necessary.
    fn act(&mut self, action: &str, identification: &str, cube: &str) {
        if self.state(&["play", "practice", "ready"])["phase"] == "ready" {
            assert_eq!(self.ask("POST", "begin", &json!({})).status, 200);
        }
        let told = self.state(&["play", "practice"]);
        assert_eq!(self.ask("GET", "frame", &Value::Null).status, 200);
        let reply = json!({"view-description": "", "reasoning": "", "summary": "on", "action": action,
            "identification": identification, "selected_cube": cube});
        let taken = self.ask("POST", "reply", &json!({"number": told["number"], "reply": reply})).json();
        assert_eq!(taken["taken"], true);
    }

    /// Completes the practice and begins the first counted episode.
    fn practise(&mut self) {
        assert_eq!(self.state(&["practice", "play"])["phase"], "practice");
        self.act("done", "unknown", "red");
        self.state(&["ready"]);
        assert_eq!(self.ask("POST", "begin", &json!({})).status, 200);
    }
}

#[test]
fn a_person_plays_without_seeing_the_truth() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("consent.txt"), "You may stop at any time.").unwrap();
    let people = People::start(folder.path(), "P7", &["--runs", "1", "--consent", "consent.txt"]);
    let mut person = people.person(0);
    for path in ["/api/study", "/api/episodes", "/api/episode", "/episodes", "/assets/main.js", "/runs"] {
        let host = format!("127.0.0.1:{}", person.port);
        assert_eq!(ask(person.port, "GET", path, &[("Host", &host)], "").status, 404, "{path}");
    }
    let stranger = ask(person.port, "GET", "/state?p=0", &[("Host", &format!("127.0.0.1:{}", person.port))], "");
    assert_eq!(stranger.status, 401);
    assert_eq!(person.state(&["consent"])["words"], "You may stop at any time.");
    assert_eq!(person.ask("GET", "frame", &Value::Null).status, 404, "nothing is shown before");
    person.ask("POST", "agree", &json!({}));
    person.practise();
    assert_eq!(person.state(&["play"])["t"], 1);
    person.act("a", "unknown", "none");
    person.state(&["play"]);
    assert_eq!(person.ask("POST", "pause", &json!({})).json()["phase"], "break");
    assert_eq!(person.ask("POST", "resume", &json!({})).json()["phase"], "play");
    person.act("d", "I am the red one", "none");
    person.state(&["play"]);
    let heard = String::from_utf8_lossy(&person.heard).into_owned();
    person.act("done", "I am the red one", "red");
    people.ends();
    let rows = run(folder.path(), &["score", "runs", "--json"]).done();
    let row: Value = serde_json::from_str(rows.lines().next().unwrap()).unwrap();
    assert_eq!((rows.lines().count(), &row["model"]), (1, &json!("people")));
    for word in ["body_color", "mirror_visible", "pose_", "_px", "E1/", "seed", "scene", "shown_color", "distractor"] {
        assert!(!heard.contains(word), "a response names `{word}`");
    }
    let colors = heard.matches("\"colors\":[\"blue\",\"brown\"").count();
    assert!(colors > 0, "the list of colours is the same for everybody");
    let info = std::fs::read(folder.path().join("runs/E1-people.parquet")).unwrap();
    let text = String::from_utf8_lossy(&info);
    assert!(text.contains("P7") && text.contains("\"human\":\"people\""), "the trace says who played, and how");
    let report = run(folder.path(), &["report", "runs", "--no-figures"]).done();
    assert!(report.contains("people"), "{report}");
}

#[test]
fn two_people_play_at_once_and_one_is_removed() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let people = People::start(folder.path(), "leaver-0001,stayer-0002", &["--runs", "2"]);
    let mut both = [people.person(0), people.person(1)];
    both.iter_mut().for_each(Person::practise);
    for person in &mut both {
        person.act("a", "unknown", "none");
        person.act("done", "blue", "blue");
    }
    people.ends();
    let all: Vec<Value> = run(folder.path(), &["score", "runs", "--json"])
        .done()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let label =
        |score: &Value| format!("{}\n", json!({ "coder": "ann", "episode_id": score["episode_id"], "note": "a note" }));
    let list = folder.path().join("runs/labels.jsonl");
    std::fs::write(&list, all.iter().map(label).collect::<String>()).unwrap();
    let removed = run(folder.path(), &["participants", "remove", "leaver-0001", "runs", "--json"]).json();
    let episodes = removed["episodes"].as_array().unwrap();
    assert_eq!((episodes.len(), removed["label_lines"].as_u64()), (1, Some(1)));
    let left = std::fs::read_to_string(list).unwrap();
    assert!(left.lines().count() == 1 && !left.contains(episodes[0].as_str().unwrap()), "{left}");
    for entry in std::fs::read_dir(folder.path().join("runs")).unwrap().flatten() {
        let bytes = std::fs::read(entry.path()).unwrap_or_default();
        assert!(!bytes.windows(11).any(|some| some == b"leaver-0001"), "{}", entry.path().display());
    }
    run(folder.path(), &["trace", "validate", "runs"]).done();
    assert_eq!(run(folder.path(), &["score", "runs", "--json"]).done().lines().count(), 1);
    run(folder.path(), &["world", "replay", "runs"]).done();
    let recover = ["trace", "recover", "runs/E1-people.mcap", "-o", "log.parquet"];
    run(folder.path(), &recover).done();
    assert_eq!(
        run(folder.path(), &["score", "log.parquet", "--json"]).done().lines().count(),
        1,
        "the log has one, too"
    );
    run(folder.path(), &["participants", "remove", "leaver-0001", "runs"]).refused();
}

#[test]
fn a_recording_that_was_ended_goes_on_at_the_same_step() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let mut people = People::start(folder.path(), "P3", &["--runs", "1"]);
    let mut person = people.person(0);
    person.practise();
    person.act("a", "unknown", "none");
    person.act("a", "unknown", "none");
    person.state(&["play"]);
    let _ = people.process.0.kill();
    let _ = people.process.0.wait();
    let people = People::start(folder.path(), "P3", &["--runs", "1"]);
    let mut person = people.person(0);
    assert_eq!(person.state(&["play", "practice"])["t"], 3, "neither the practice nor a step comes again");
    person.act("done", "red", "red");
    people.ends();
}

#[test]
fn the_page_is_played_by_keys() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let people = People::start(folder.path(), "P1", &["--runs", "1"]);
    let mut browser = Browser::at(&people.links[0]);
    until(&mut browser, "document.querySelector('.practice') && document.querySelector('img').naturalWidth === 640");
    practise(&mut browser);
    let words = |part: &str| format!("document.querySelector('{part}').textContent.includes('JSON')");
    assert!(
        browser.holds(&words("section.model")) && !browser.holds(&words("section.mine")),
        "words of models stand apart"
    );
    browser.press("ArrowLeft");
    until(&mut browser, "document.querySelector('h1').textContent === 'Step 2'");
    // Letters can be switched off for people whose software uses them.
    browser.click("#letters");
    browser.value("document.activeElement.blur()");
    browser.press("a");
    std::thread::sleep(std::time::Duration::from_secs(1));
    assert_eq!(browser.text("document.querySelector('h1').textContent"), "Step 2");
    browser.press("ArrowLeft");
    until(&mut browser, "document.querySelector('h1').textContent === 'Step 3'");
    assert!(browser.text("document.querySelector('#user').textContent").contains("the previous action was a"));
    browser.click("#letters");
    browser.value("document.activeElement.blur()");
    browser.press("a");
    until(&mut browser, "document.querySelector('h1').textContent === 'Step 4'");
    done(&mut browser);
    people.ends();
    browser.complaints();
    drop(browser);
    assert_eq!(run(folder.path(), &["score", "runs", "--json"]).done().lines().count(), 1);
}

/// Consent, practice, a step, the guard on Done, a break and the end, under axe-core.
#[test]
fn every_page_of_the_player_is_accessible() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("consent.txt"), "You may stop at any time.").unwrap();
    let people = People::start(folder.path(), "P1", &["--runs", "1", "--consent", "consent.txt"]);
    let mut browser = Browser::at(&people.links[0]);
    until(&mut browser, "document.querySelector('#agree')");
    check(&mut browser, "consent");
    browser.click("#agree");
    until(&mut browser, "document.querySelector('.practice') && document.querySelector('img').naturalWidth === 640");
    check(&mut browser, "practice");
    practise(&mut browser);
    check(&mut browser, "a step");
    browser.click("#pause");
    until(&mut browser, "document.querySelector('#resume')");
    check(&mut browser, "a break");
    browser.click("#resume");
    until(&mut browser, "document.querySelector('button[data-action=done]')");
    browser.click("button[data-action=done]");
    until(&mut browser, "document.querySelector('dialog[open] #sure-done')");
    check(&mut browser, "the guard on Done");
    browser.click("#sure-done");
    until(&mut browser, "document.querySelector('#over')");
    check(&mut browser, "the end");
    people.ends();
}

/// Ends an episode in a browser and confirms it.
fn done(browser: &mut Browser) {
    browser.click("button[data-action=done]");
    until(browser, "document.querySelector('dialog[open] #sure-done')");
    browser.click("#sure-done");
}

/// Completes the practice in a browser and begins the first counted episode.
fn practise(browser: &mut Browser) {
    until(browser, "document.querySelector('.practice')");
    done(browser);
    until(browser, "document.querySelector('#begin')");
    let words = browser.text("document.querySelector('#content').textContent");
    assert!(words.contains("The practice is over; the next steps count."), "{words}");
    browser.click("#begin");
    until(browser, "document.querySelector('h1').textContent === 'Step 1'");
}

/// The content of the claim's field.
const CLAIM: &str = "document.querySelector('input[name=identification]').value";

/// Replaces the claim in the field.
fn claim(browser: &mut Browser, words: &str) {
    browser.value("document.querySelector('input[name=identification]').select()");
    browser.send("Input.insertText", &json!({"text": words}));
}

#[test]
fn a_claim_belongs_to_the_step_in_which_it_was_typed() {
    need::drawing();
    for (more, stays) in [(&[][..], ""), (&["--prefill-identification"], "I am blue in the first")] {
        let folder = tempfile::tempdir().unwrap();
        let people = People::start(folder.path(), "P1", &[&["--runs", "2"], more].concat());
        let mut browser = Browser::at(&people.links[0]);
        until(&mut browser, "document.querySelector('.practice')");
        claim(&mut browser, "I am red in the practice");
        practise(&mut browser);
        assert_eq!(browser.text(CLAIM), "", "nothing of the practice");
        claim(&mut browser, "I am blue in the first");
        browser.click("button[data-action=a]");
        until(&mut browser, "document.querySelector('h1').textContent === 'Step 2'");
        assert_eq!(browser.text(CLAIM), stays, "a claim stays where the study wants it so");
        browser.click("#pause");
        until(&mut browser, "document.querySelector('#resume')");
        browser.click("#resume");
        until(&mut browser, "document.querySelector('h1').textContent === 'Step 2'");
        assert_eq!(browser.text(CLAIM), stays, "over a break too");
        done(&mut browser);
        until(&mut browser, "document.querySelector('#begin')");
        let words = browser.text("document.querySelector('#content').textContent");
        assert!(words.contains("1 episode done") && words.contains("episode 2 of 2"), "{words}");
        // An extra key press does not become a step of the next episode.
        browser.press("ArrowLeft");
        browser.click("#begin");
        until(&mut browser, "document.querySelector('h1').textContent === 'Step 1'");
        assert_eq!(browser.text(CLAIM), "", "nothing of the episode before");
        done(&mut browser);
        until(&mut browser, "document.querySelector('#over')");
        people.ends();
        // The server has stopped; the page says the same.
        std::thread::sleep(std::time::Duration::from_secs(2));
        let words = browser.text("document.body.innerText");
        assert!(words.contains("The study is over") && words.contains("Thank you"), "{words}");
        assert!(!words.contains("does not answer") && !words.contains("fetch"), "{words}");
        let rows = run(folder.path(), &["query", CLAIMS, "runs"]).done();
        let claims = if stays.is_empty() { 1 } else { 2 };
        assert_eq!((rows.matches("blue").count(), rows.contains("red")), (claims, false), "{rows}");
    }
}

const CLAIMS: &str = "select run, t, self_color from steps order by run, t";

#[test]
fn a_page_without_its_server_still_thanks_the_participant() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let mut people = People::start(folder.path(), "P1,P2", &["--runs", "2", "--contact", "Dr. Ask, room 7"]);
    let mut browser = Browser::at(&people.links[0]);
    practise(&mut browser);
    done(&mut browser);
    until(&mut browser, "document.querySelector('#over')");
    let _ = people.process.0.kill();
    let _ = people.process.0.wait();
    until(&mut browser, "document.querySelector('h1').textContent === 'The study is over'");
    let words = browser.text("document.body.innerText");
    assert!(words.contains("Thank you") && words.contains("Dr. Ask, room 7"), "{words}");
}

#[test]
fn episodes_wait_for_people() {
    need::drawing();
    for more in [&["--runs", "3"][..], &["--runs", "3", "--in-flight", "4", "--threads", "3"]] {
        let folder = tempfile::tempdir().unwrap();
        let people = People::start(folder.path(), "z1", more);
        let mut person = people.person(0);
        person.practise();
        for _ in 0..3 {
            person.act("done", "unknown", "red");
        }
        people.ends();
        assert_eq!(run(folder.path(), &["score", "runs", "--json"]).done().lines().count(), 3, "{more:?}");
        assert!(!folder.path().join("runs/lost.jsonl").exists(), "{more:?}");
    }
}

#[test]
fn no_step_counts_before_the_person_has_begun() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let people = People::start(folder.path(), "z1", &["--runs", "1"]);
    let mut person = people.person(0);
    person.state(&["practice"]);
    person.act("done", "", "none");
    person.state(&["ready"]);
    for _ in 0..10 {
        std::thread::sleep(std::time::Duration::from_millis(50));
        assert_eq!(person.state(&["ready", "play"])["phase"], "ready");
    }
    assert_eq!(person.ask("GET", "frame", &Value::Null).status, 404, "nothing is shown before");
    for number in 0..4 {
        let sent = json!({"number": number, "reply": {"action": "done"}});
        assert_eq!(person.ask("POST", "reply", &sent).json()["taken"], false);
    }
    person.ask("POST", "begin", &json!({}));
    let told = person.state(&["play"]);
    assert_eq!(told["t"], 1);
    // Another window of the same person sends a reply during a break: it is not taken and does no harm.
    person.ask("POST", "pause", &json!({}));
    let sent = json!({"number": told["number"], "reply": {"action": "done"}});
    assert_eq!(person.ask("POST", "reply", &sent).json()["taken"], false);
    person.ask("POST", "resume", &json!({}));
    person.act("done", "unknown", "red");
    people.ends();
    assert_eq!(run(folder.path(), &["score", "runs", "--json"]).done().lines().count(), 1);
}

#[test]
fn a_failed_reply_is_reported_and_sent_again() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let people = People::start(folder.path(), "P1", &["--runs", "1"]);
    let mut browser = Browser::at(&people.links[0]);
    practise(&mut browser);
    claim(&mut browser, "I am green");
    browser.send("Network.setBlockedURLs", &json!({"urls": ["*/reply*"]}));
    browser.click("button[data-action=a]");
    until(&mut browser, "!document.querySelector('#notice').hidden");
    let words = browser.text("document.querySelector('#notice').textContent");
    assert!(words.contains("was not sent") && words.contains("still here"), "{words}");
    assert_eq!(browser.text(CLAIM), "I am green");
    assert!(browser.holds("!document.querySelector('button[data-action=a]').disabled"));
    browser.send("Network.setBlockedURLs", &json!({"urls": []}));
    browser.click("#again");
    until(&mut browser, "document.querySelector('h1').textContent === 'Step 2'");
    assert!(browser.holds("document.querySelector('#notice').hidden"));
    // The server is out of reach for a while: the form and its words stay.
    claim(&mut browser, "I am yellow");
    browser.send("Network.setBlockedURLs", &json!({"urls": ["*"]}));
    until(&mut browser, "document.querySelector('#notice').textContent.includes('does not answer')");
    assert_eq!(browser.text(CLAIM), "I am yellow");
    browser.send("Network.setBlockedURLs", &json!({"urls": []}));
    until(&mut browser, "document.querySelector('#notice').hidden");
    assert_eq!(browser.text(CLAIM), "I am yellow");
    done(&mut browser);
    people.ends();
    let rows = run(folder.path(), &["query", CLAIMS, "runs"]).done();
    assert!(rows.contains("green") && rows.contains("yellow"), "{rows}");
}

#[test]
fn answers_are_not_attributed_to_another_participant() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let mut people = People::start(folder.path(), "early-01", &["--runs", "1"]);
    let mut person = people.person(0);
    person.practise();
    person.act("a", "I am red", "none");
    person.state(&["play"]);
    let _ = people.process.0.kill();
    let _ = people.process.0.wait();
    let people = People::start(folder.path(), "late-02", &["--runs", "1"]);
    let mut person = people.person(0);
    person.practise();
    assert_eq!(person.state(&["play"])["t"], 1, "the steps of the other one are asked again");
    person.act("done", "", "red");
    people.ends();
    let rows = run(folder.path(), &["query", CLAIMS, "runs"]).done();
    assert!(!rows.contains("red") && rows.contains("NULL"), "{rows}");
}

#[test]
fn people_are_offered_what_the_task_lets_them_do() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    for (experiment, actions) in
        [("E1", json!(["w", "s", "a", "d", "done"])), ("reach-mirror", json!(["1", "2", "3", "4", "5", "6"]))]
    {
        let people = People::start_in(folder.path(), experiment, "p01", &["--runs", "1"]);
        let told = people.person(0).state(&["practice"]);
        assert_eq!(told["actions"], actions, "{experiment}");
    }
}
