//! Studies with people: designs, consent, withdrawal, interruptions.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::{CLAIM, CLAIMS, People, Person, claim, done, practise};
use crate::harness::need;
use crate::harness::program::{interrupt, program, run, wait_for};
use crate::html::browser::Browser;
use crate::view::pages::until;

/// The files of a folder that contain these bytes.
fn files_with(folder: &Path, bytes: &str) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten().filter(|entry| entry.path().is_file()) {
        let content = std::fs::read(entry.path()).unwrap();
        if content.windows(bytes.len()).any(|some| some == bytes.as_bytes()) {
            found.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    found
}

/// The phase of a person's page, once it is one of these.
fn phase(person: &mut Person, phases: &[&str]) -> String {
    person.state(phases)["phase"].as_str().unwrap().to_owned()
}

impl Person {
    fn post(&mut self, name: &str, body: &Value) -> Value {
        self.ask("POST", name, body).json()
    }

    /// Waits until there is an episode, even across a restart of the server.
    fn answers_again(&self) {
        wait_for("the next recording", || {
            let mut stream = TcpStream::connect(("127.0.0.1", self.port)).ok()?;
            let (token, host) = (&self.token, format!("127.0.0.1:{}", self.port));
            write!(stream, "GET /state?p={token} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").ok()?;
            let mut answer = String::new();
            stream.read_to_string(&mut answer).ok()?;
            answer.contains("\"ready\"").then_some(())
        });
    }

    /// Plays an episode of two steps.
    fn play(&mut self) {
        self.act("a", "", "none");
        self.act("done", "I am red", "red");
    }

    fn begins(&mut self) {
        phase(self, &["consent"]);
        self.post("agree", &json!({}));
        self.practise();
    }

    /// The behaviour of participant `number` in the study of twenty.
    fn takes_part(&mut self, number: usize) {
        match number {
            1 | 2 => {
                self.begins();
                self.act("a", "", "none");
                let before = self.state(&["play"]);
                // Loading the page again asks the same question.
                assert_eq!(self.ask("GET", "", &Value::Null).status, 200);
                let after = self.state(&["play"]);
                assert_eq!((&after["t"], &after["number"], &after["t"]), (&before["t"], &before["number"], &json!(2)));
                self.act("done", "I am red", "red");
                self.play();
            }
            3 => {
                phase(self, &["consent"]);
                assert_eq!(self.post("decline", &json!({}))["left"], "declined");
                assert_eq!(self.ask("GET", "frame", &Value::Null).status, 404);
            }
            4 => {
                self.begins();
                self.play();
                self.act("a", "I am blue", "none");
                phase(self, &["play"]);
                let told = self.post("withdraw", &json!({"delete": true}));
                assert_eq!((&told["left"], &told["is_deleted"]), (&json!("deleted"), &json!(true)));
                let sent = json!({"number": told["number"], "reply": {"action": "done"}});
                assert_eq!(self.post("reply", &sent)["taken"], false);
            }
            5 => {
                self.begins();
                self.act("a", "", "none");
                self.state(&["play"]);
                // No page sends requests for a while, so the clock stops.
                thread::sleep(Duration::from_secs(12));
                self.act("done", "I am red", "red");
                self.play();
            }
            _ => {
                self.begins();
                self.play();
                self.play();
            }
        }
        if number == 3 || number == 4 {
            assert_eq!(phase(self, &["left"]), "left");
        } else {
            let told = self.state(&["finished", "over"]);
            assert_eq!(told["played"], 2, "{told}");
        }
    }
}

#[test]
fn twenty_people_play_every_scene_but_for_one_who_declines_and_one_who_withdraws() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("consent.txt"), "You may stop at any time.").unwrap();
    let codes: Vec<String> = (1..=20).map(|number| format!("person-{number:02}")).collect();
    let codes = codes.join(",");
    let more = ["--runs", "2", "--design", "crossed", "--consent", "consent.txt", "--in-flight", "3", "--json"];
    let start = |name: &str| {
        let answer = File::create(folder.path().join(name)).unwrap();
        People::start_telling(folder.path(), "E1", &codes, &more, answer.into())
    };
    let answer =
        |name: &str| -> Value { serde_json::from_slice(&std::fs::read(folder.path().join(name)).unwrap()).unwrap() };
    let people = start("first.json");
    let links = people.links.clone();
    let persons: Vec<Person> = (0..20).map(|at| people.person(at)).collect();
    let players =
        persons.into_iter().zip(1..).map(|(mut person, number)| thread::spawn(move || person.takes_part(number)));
    players.collect::<Vec<_>>().into_iter().for_each(|player| player.join().unwrap());
    people.ends();
    let first = answer("first.json");
    let counts = |answer: &Value| ["asked", "found", "recorded", "left_out"].map(|key| answer[key].as_u64().unwrap());
    assert_eq!((counts(&first), first["stopped"].as_bool()), ([40, 0, 36, 4], Some(false)), "{first}");

    // Traces: everyone who stayed has played both scenes once.
    run(folder.path(), &["trace", "validate", "runs"]).done();
    let of_each = "select participant, count(distinct episode_id) as n, count(distinct scene) as scenes from steps group by participant";
    let rows = run(folder.path(), &["query", of_each, "runs", "--format", "csv"]).done();
    let rows: Vec<&str> = rows.lines().skip(1).collect();
    assert!(rows.len() == 18 && rows.iter().all(|row| row.ends_with(",2,2")), "{rows:?}");
    let times = "select max(latency_ms) as most from steps where participant = 'person-05'";
    let most = run(folder.path(), &["query", times, "runs", "--format", "csv"]).done();
    assert!(most.lines().nth(1).unwrap().parse::<u64>().unwrap() < 10_000, "{most}");

    // Statistics: a person counts once, and two people on one scene are not a repetition.
    let stats = run(folder.path(), &["stats", "runs", "--json"]).json();
    let chance = stats["chance"].as_array().unwrap();
    let units: Vec<&Value> = chance.iter().map(|row| &row["units"]).collect();
    assert!(!units.is_empty() && units.iter().all(|it| it["n"] == 18 && it["name"] == "participants"), "{units:?}");
    assert_eq!(stats["retests"], json!([]));

    // Deletions: the only thing left of people who withdrew is the entry that says so.
    for code in ["person-03", "person-04"] {
        assert_eq!(files_with(&folder.path().join("runs"), code), ["participants.jsonl"], "{code}");
    }
    let journal = std::fs::read_to_string(folder.path().join("runs/participants.jsonl")).unwrap();
    let own: Vec<Value> = journal
        .lines()
        .filter(|line| line.contains("person-04"))
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert!(own.len() == 2 && own.iter().any(|line| line["left"] == "deleted"), "{own:?}");
    assert!(!journal.contains("I am blue"), "{journal}");
    let firsts: Vec<Value> = ["person-01", "person-02"]
        .map(|code| {
            let answers = journal.lines().filter(|line| line.contains(code) && line.contains("episode_id"));
            serde_json::from_str::<Value>(answers.into_iter().next().unwrap()).unwrap()["episode_id"].clone()
        })
        .into();
    assert_eq!(firsts, ["E1/people/s1/r1", "E1/people/s1/r2/x2"], "the order is counterbalanced");

    // Again: nothing remains to record, the links are the same, and people who withdrew are not asked.
    let people = start("second.json");
    assert_eq!(people.links.iter().map(token).collect::<Vec<_>>(), links.iter().map(token).collect::<Vec<_>>());
    people.ends();
    assert_eq!(counts(&answer("second.json")), [40, 36, 0, 4]);
}

/// The secret part of a link.
fn token(link: &String) -> &str {
    let token = link.split_once("?p=").unwrap().1;
    assert_eq!(token.len(), 32, "{link}");
    token
}

#[test]
fn one_interrupt_ends_a_recording_that_waits_for_a_person() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    for has_begun in [false, true] {
        let mut people = People::start(folder.path(), "P1", &["--runs", "1"]);
        let mut person = people.person(0);
        if has_begun {
            person.practise();
            person.act("a", "", "none");
            person.state(&["play"]);
        }
        let start = Instant::now();
        interrupt(&people.process.0);
        assert_eq!(people.process.0.wait().unwrap().code(), Some(130));
        assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
    }
    let people = People::start(folder.path(), "P1", &["--runs", "1"]);
    let mut person = people.person(0);
    assert_eq!(person.state(&["play"])["t"], 2, "the episode goes on where it was");
    person.act("done", "", "red");
    people.ends();
}

#[test]
fn the_others_play_the_episodes_left_by_a_participant() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let people = People::start(folder.path(), "a1,b2", &["--runs", "4"]);
    let [mut first, mut second] = [people.person(0), people.person(1)];
    first.practise();
    first.play();
    first.act("a", "I am blue", "none");
    let told = first.state(&["play"]);
    assert_eq!((&told["episode"], &told["of"]), (&json!(2), &json!(2)));
    assert_eq!(first.post("withdraw", &json!({"delete": false}))["left"], "stopped");
    second.practise();
    for _ in 0..3 {
        second.play();
    }
    people.ends();
    let of_each =
        "select participant, count(distinct episode_id) as n from steps group by participant order by participant";
    let rows = run(folder.path(), &["query", of_each, "runs", "--format", "csv"]).done();
    assert_eq!(rows.lines().skip(1).collect::<Vec<_>>(), ["a1,1", "b2,3"], "what was played before stays");
}

#[test]
fn participants_have_seeds_of_their_own() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let people = People::start(folder.path(), "a1,b2", &["--runs", "1", "--design", "own-seeds"]);
    for at in 0..2 {
        let mut person = people.person(at);
        person.practise();
        person.play();
    }
    people.ends();
    let of_each = "select distinct participant, seed from steps order by participant";
    let rows = run(folder.path(), &["query", of_each, "runs", "--format", "csv"]).done();
    assert_eq!(rows.lines().skip(1).collect::<Vec<_>>(), ["a1,1", "b2,2"]);
    let moved =
        ["record", "--agent", "human", "--model", "people", "--experiment", "E1", "--seeds", "1", "--runs", "1"];
    let moved = [&moved[..], &["--out", "runs", "--human-port", "0", "--design", "own-seeds", "--participants", "b2"]];
    let refused = run(folder.path(), &moved.concat()).refused();
    assert!(
        refused.contains("`b2` has place 1, and had place 2") && refused.contains("help: keep the order"),
        "{refused}"
    );
}

#[test]
fn typed_text_survives_a_reload() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let mut people = People::start(folder.path(), "P1", &["--runs", "1"]);
    let mut browser = Browser::at(&people.links[0]);
    practise(&mut browser);
    claim(&mut browser, "I am half way");
    browser.send("Page.reload", &json!({}));
    until(
        &mut browser,
        &format!("document.querySelector('h1').textContent === 'Step 1' && {CLAIM} === 'I am half way'"),
    );
    claim(&mut browser, "I am green");
    browser.click("button[data-action=a]");
    until(&mut browser, "document.querySelector('h1').textContent === 'Step 2'");
    browser.send("Page.reload", &json!({}));
    until(&mut browser, "document.querySelector('h1').textContent === 'Step 2'");
    assert_eq!(browser.text(CLAIM), "", "what was sent is not typed again");
    done(&mut browser);
    until(&mut browser, "document.querySelector('#over')");
    assert!(people.process.0.wait().unwrap().success());
    let rows = run(folder.path(), &["query", CLAIMS, "runs"]).done();
    assert_eq!(rows.matches("green").count(), 1, "{rows}");
}

#[test]
fn a_person_declines_or_leaves_by_the_keyboard_alone() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("consent.txt"), "You may stop at any time.").unwrap();
    let more = ["--runs", "1", "--consent", "consent.txt", "--contact", "Dr. Ask, room 7"];
    let people = People::start(folder.path(), "P1,P2", &more);
    let mut first = Browser::at(&people.links[0]);
    until(&mut first, "document.querySelector('#decline')");
    assert!(first.holds("document.activeElement.tagName === 'H1'"), "the keyboard begins at the heading");
    first.value("document.querySelector('#decline').focus()");
    first.press("Enter");
    until(&mut first, "document.activeElement.id === 'decline-stay'");
    first.press("Tab");
    first.press("Enter");
    until(&mut first, "document.querySelector('#left')");
    let words = first.text("document.body.innerText");
    assert!(words.contains("Nothing of you is recorded") && words.contains("Dr. Ask, room 7"), "{words}");
    let mut second = Browser::at(&people.links[1]);
    until(&mut second, "document.querySelector('#agree')");
    second.value("document.querySelector('#agree').focus()");
    second.press("Enter");
    until(&mut second, "document.querySelector('.practice')");
    assert!(second.holds("document.querySelector('#status').getAttribute('role') === 'status'"));
    // A confirmation before an episode ends: Escape goes back to the episode.
    second.value("document.querySelector('button[data-action=done]').focus()");
    second.press("Enter");
    until(&mut second, "document.activeElement.id === 'sure-stay'");
    second.press("Escape");
    until(&mut second, "document.querySelector('dialog') === null");
    assert!(second.holds("document.activeElement.dataset.action === 'done'"));
    let look = "(() => { const one = document.querySelector('#pause'); one.disabled = true; const is = getComputedStyle(one); \
                return [is.cursor, is.borderTopStyle]; })()";
    assert_eq!(second.value(look), json!(["not-allowed", "dashed"]), "what cannot be pressed looks so");
    second.value("document.querySelector('#withdraw').focus()");
    second.press("Enter");
    until(&mut second, "document.querySelector('#leave-delete')");
    second.value("document.querySelector('#leave-delete').focus()");
    second.press("Enter");
    until(&mut second, "document.querySelector('#left')");
    assert!(second.text("document.body.innerText").contains("What you did is deleted"));
    people.ends();
    assert!(!folder.path().join("runs/E1-people.parquet").exists(), "nobody has played an episode");
}

#[test]
fn a_study_file_has_conditions_that_the_same_person_plays() {
    need::drawing();
    let folder = tempfile::tempdir().unwrap();
    let port = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap().local_addr().unwrap().port();
    let study = format!(
        "agent = \"human\"\nexperiment = \"E1\"\nseeds = 1\nruns = 1\nparticipants = \"P1\"\nhuman-port = {port}\n\
         out = \"runs\"\n[model.people]\n[condition.far]\n[condition.near]\n"
    );
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    let people = People::start_with(program(folder.path()).args(["record", "study.toml"]), 1, Stdio::null());
    let mut person = people.person(0);
    person.practise();
    person.play();
    // The same link continues with the next condition, without another practice.
    person.answers_again();
    person.play();
    people.ends();
    let conditions = "select distinct condition, participant from steps order by condition";
    let rows = run(folder.path(), &["query", conditions, "runs", "--format", "csv"]).done();
    assert_eq!(rows.lines().skip(1).collect::<Vec<_>>(), ["far,P1", "near,P1"]);
}
