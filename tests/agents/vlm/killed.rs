//! Recordings that are killed repeatedly: every episode is recorded once, and no answer is requested twice.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use mirrorstats_exact::hash;
use mirrorstats_vlm::journal::Entry;
use mirrorstats_vlm::wire_format::WireFormat;

use super::recordings::{Folder, counting};
use super::server::{JSON, Request, Server, http, whole};
use crate::harness::program::{run, stderr};

const STEPS: u32 = 4;

/// Every twentieth request fails, each time in another way. The other answers are all different, so that no two later
/// requests are the same.
fn answer(at: usize, request: &Request) -> Vec<u8> {
    sleep(Duration::from_millis(2));
    match at % 100 {
        7 => http("500 Internal Server Error", "retry-after: 0\r\n", b""),
        27 => http("503 Service Unavailable", "retry-after: 0\r\n", b"busy"),
        47 => http("429 Too Many Requests", "retry-after: 0\r\n", b"slow down"),
        67 => http("502 Bad Gateway", "retry-after: 0\r\ncontent-type: text/html\r\n", b"<html>"),
        87 => format!("HTTP/1.1 200 OK\r\n{JSON}content-length: 100\r\n\r\nhalf").into_bytes(),
        _ => whole(WireFormat::OpenaiCompatible, &counting(request, STEPS, at)),
    }
}

/// The identity of a request: model, words and frame, hashed like journals do.
fn question(request: &Request) -> String {
    let (before, image) = request.body.split_once("data:image/png;base64,").unwrap();
    let (_, after) = image.split_once('"').unwrap();
    hash::of_bytes(format!("{before}data:image/png;base64,\"{after}").as_bytes())
}

/// Pseudo-random numbers below `end` at which the process is killed.
fn moments(count: usize, end: usize) -> Vec<usize> {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut found = BTreeSet::new();
    while found.len() < count {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        found.insert((state >> 33) as usize % end);
    }
    found.into_iter().collect()
}

struct Study {
    folder: Folder,
    server: Server,
    models: Vec<String>,
    words: String,
}

impl Study {
    /// Starts the recordings of all models in turn. Kills the running one once the server has had `until` requests.
    /// Returns true if all ended normally.
    fn start(&self, until: Option<usize>) -> bool {
        self.models.iter().all(|model| {
            let mut command = self.folder.record(&self.server, model, &self.words);
            let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
            self.outlives(&mut child, until) && {
                let output = child.wait_with_output().unwrap();
                assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
                true
            }
        })
    }

    /// Waits for the end of a process, or kills it at its moment.
    fn outlives(&self, child: &mut Child, until: Option<usize>) -> bool {
        while child.try_wait().unwrap().is_none() {
            if until.is_some_and(|moment| self.server.count() > moment) {
                child.kill().unwrap();
                child.wait().unwrap();
                return false;
            }
            sleep(Duration::from_micros(300));
        }
        true
    }

    /// The questions with an answer on disk.
    fn answered(&self) -> BTreeSet<String> {
        let entries = self.folder.journals().into_values().flatten();
        entries
            .filter_map(|entry| match entry {
                // Before the first answer, two episodes may send the same request.
                Entry::Answer { t, question, .. } if t > 1 => Some(question),
                _ => None,
            })
            .collect()
    }

    /// The identifiers of the episodes in the traces.
    fn episodes(&self) -> Vec<String> {
        let scores = run(self.folder.path(), &["score", "runs"]).done();
        let mut rows = csv::Reader::from_reader(scores.as_bytes());
        let id = rows.headers().unwrap().iter().position(|header| header == "episode_id").unwrap();
        rows.records().map(|row| row.unwrap()[id].to_owned()).collect()
    }
}

/// The number of times that each question was sent; checks that no answered question was sent again.
fn journaled(journals: &BTreeMap<PathBuf, Vec<Entry>>) -> BTreeMap<String, usize> {
    let mut sent = BTreeMap::new();
    for (path, entries) in journals {
        let mut answered = BTreeSet::new();
        for entry in entries {
            match entry {
                Entry::Request { t, question, .. } => {
                    assert!(!answered.contains(t), "step {t} of {} was asked for again", path.display());
                    *sent.entry(question.clone()).or_default() += 1;
                }
                Entry::Answer { t, .. } => assert!(answered.insert(*t), "step {t} has two answers"),
                Entry::Failure { .. } => {}
            }
        }
    }
    sent
}

fn check(models: usize, runs: usize, kills: usize) {
    let study = Study {
        folder: Folder::new(),
        server: Server::start(answer),
        models: (1..=models).map(|at| format!("model-{at}")).collect(),
        words: format!("--seeds 3 --runs {runs} --threads 1 --in-flight 6"),
    };
    let episodes = models * 3 * runs;
    let mut killed = 0;
    // The last quarter is left over, so that every start still has work at its moment.
    for moment in moments(kills, episodes * STEPS as usize * 3 / 4) {
        let (answered, before) = (study.answered(), study.server.count());
        killed += usize::from(!study.start(Some(moment.max(before))));
        for request in &study.server.requests()[before..] {
            assert!(!answered.contains(&question(request)), "asked for what was journaled:\n{}", request.head);
        }
    }
    assert_eq!(killed, kills, "a recording ended before its moment");
    assert!(study.start(None));

    let mut sent = journaled(&study.folder.journals());
    for request in study.server.requests() {
        let left = sent.get_mut(&question(&request)).filter(|left| **left > 0);
        *left.expect("a request went out that is in no journal") -= 1;
    }
    let found = study.episodes();
    let distinct: BTreeSet<_> = found.iter().collect();
    assert_eq!((found.len(), distinct.len()), (episodes, episodes));
    let asked = study.server.count();
    assert!(study.start(None));
    assert_eq!(study.server.count(), asked, "a whole recording asks for nothing");
}

#[test]
fn repeated_kills_lose_no_episode_and_repeat_no_request() {
    check(2, 2, 6);
}

#[test]
#[ignore = "soak: eight models, twenty-one episodes each, killed twenty times"]
fn soak_twenty_kills_of_eight_models_lose_no_episode_and_repeat_no_request() {
    check(8, 7, 20);
}
