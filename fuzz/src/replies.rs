//! The answers of providers and programs, and their journals.

use std::fs;

use mirrorstats_agents::Status;
use mirrorstats_agents::reply::{self, Ending};
use mirrorstats_experiment::Experiment;
use mirrorstats_vlm::journal::{Entry, Journal, Recorded};
use mirrorstats_vlm::wire_format::WireFormat;

use crate::depth::reached;
use crate::scratch;

const WIRE_FORMATS: [WireFormat; 4] =
    [WireFormat::OpenaiChat, WireFormat::OpenaiCompatible, WireFormat::Gemini, WireFormat::AnthropicMessages];

/// A reply's text, from a program or a model.
fn text(raw: &str, ending: Ending) {
    for experiment in [Experiment::E1, Experiment::E5] {
        let reading = reply::read(raw, &experiment, ending);
        assert_eq!(reading, reply::read(raw, &experiment, ending));
        let is_read = matches!(reading.status, Status::Ok | Status::Repaired);
        assert_eq!(is_read, reading.fault.is_none() && reading.action.is_some() && ending == Ending::Whole);
        assert_eq!(reading.status == Status::Repaired, !reading.repairs.is_empty());
        if is_read {
            reached("decision");
        } else {
            assert!(reading.selected_cube.is_none() && reading.self_color.is_none(), "{reading:?}");
        }
    }
}

/// The body of a provider's answer; the first byte chooses the provider, or a plain reply text.
pub fn target(data: &[u8]) {
    let Some((first, data)) = data.split_first() else { return };
    let Ok(body) = std::str::from_utf8(data) else { return };
    let Some(wire_format) = WIRE_FORMATS.get(usize::from(first % 6)) else {
        text(body, Ending::Whole);
        return;
    };
    if let Ok(Some(answer)) = wire_format.read(body) {
        reached("answer");
        assert_eq!(wire_format.read(body).ok().flatten(), Some(answer.clone()));
        text(&answer.text, answer.ending);
    }
}

fn all(journal: &Journal) -> Vec<Recorded> {
    journal.answers().cloned().collect()
}

/// A journal left by a process: it is refused, or it can be appended to and plays old and new answers.
pub fn journal(data: &[u8]) {
    let path = scratch::file("journal.jsonl", data);
    let cassette = Journal::cassette(&path).map(|cassette| all(&cassette));
    let Ok(mut journal) = Journal::open(&path) else {
        assert!(cassette.is_err(), "a cassette plays a journal that is refused");
        return;
    };
    reached("opened");
    assert_eq!(all(&journal), cassette.expect("a journal is a cassette"));
    let entry = Entry::Answer {
        t: 7,
        attempt: 1,
        question: "q".into(),
        latency_ms: 3,
        model: None,
        body: "{\"é\": \"\\ud800\n\"}".into(),
    };
    journal.append(&entry).expect("a folder for temporary files");
    let (after, again) = (all(&journal), Journal::cassette(&path).expect("a journal that was written"));
    assert_eq!((all(&again), again.requests()), (after, journal.requests()));
}

/// A cassette: the answers that it plays are read as replies.
pub fn cassette(data: &[u8]) {
    let path = scratch::file("cassette.jsonl", data);
    let Ok(cassette) = Journal::cassette(&path) else { return };
    assert!(fs::read(&path).is_ok_and(|bytes| bytes == data), "a cassette is not written to");
    reached("played");
    for recorded in cassette.answers() {
        for wire_format in WIRE_FORMATS {
            if let Ok(Some(answer)) = wire_format.read(&recorded.body) {
                text(&answer.text, answer.ending);
            }
        }
    }
}
