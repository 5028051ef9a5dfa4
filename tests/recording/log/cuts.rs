//! A log that is cut off at any byte.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;

use super::logs::{Desk, RECORDING, ids, json, recovered};

/// Checks that a log cut at this byte gives every ended episode unchanged, and that the cut is reported.
fn check(at: usize) {
    let whole = recovered(&RECORDING.log);
    let found = recovered(&RECORDING.log[..at]);
    let ended = RECORDING.ended(at);
    assert_eq!(ids(&found), ended, "cut at byte {at}");
    assert_eq!(found.episodes, whole.episodes[..ended.len()], "cut at byte {at}");
    assert!(found.losses.cut.is_some() || !found.losses.damage.is_empty(), "cut at byte {at}: {:?}", found.losses);
    if !ended.is_empty() {
        assert_eq!(found.recording, whole.recording, "cut at byte {at}");
    }
}

#[test]
fn a_log_cut_at_or_near_a_record_is_recovered() {
    assert!(RECORDING.boundaries().len() > 20);
    for at in RECORDING.boundaries() {
        for at in [at - 1, at, at + 1, at + 9] {
            check(at.clamp(mcap::MAGIC.len(), RECORDING.log.len() - 1));
        }
    }
}

#[test]
fn the_program_recovers_logs_cut_at_fifty_bytes() {
    let desk = Desk::new();
    // Steps by the golden section cover the whole file evenly, whatever its length.
    let length = RECORDING.log.len() - mcap::MAGIC.len();
    let places = (1..=50_usize).map(|nth| mcap::MAGIC.len() + nth * (length * 618 / 1000) % length);
    let mut seen = [0; 4];
    for at in places {
        let output = desk.recover(&RECORDING.log[..at], &["--json"]);
        assert_eq!(output.status.code(), Some(3), "cut at byte {at}");
        let ended = RECORDING.ended(at);
        seen[ended.len()] += 1;
        let answer = json(&output);
        assert_eq!(answer["episodes"], ended.len(), "cut at byte {at}: {answer}");
        assert_eq!(answer["written"], !ended.is_empty(), "cut at byte {at}");
        assert_eq!(desk.trace().exists(), !ended.is_empty(), "cut at byte {at}");
        if !ended.is_empty() {
            assert_eq!(desk.validated(), ended, "cut at byte {at}");
        }
    }
    assert!(seen.iter().all(|count| *count > 0), "cuts by the episodes that had ended: {seen:?}");
}

#[test]
fn losses_are_named() {
    let desk = Desk::new();
    let said = |bytes: &[u8]| String::from_utf8(desk.recover(bytes, &[]).stdout).unwrap();
    let (_, second) = RECORDING.chunks[1];
    let text = said(&RECORDING.log[..second]);
    assert!(text.starts_with("recovered 2 episodes, ") && text.contains("ends before its end record"), "{text}");
    let text = said(&RECORDING.log[..RECORDING.log.len() - 20]);
    assert!(text.starts_with("recovered 3 episodes, ") && text.contains("behind all that was recorded"), "{text}");
    let text = said(&RECORDING.log[..mcap::MAGIC.len()]);
    assert!(text.starts_with("recovered no episode; no trace was written"), "{text}");
}

#[test]
fn an_episode_cut_after_its_beginning_is_named_with_its_rows() {
    let mut log = mcap::WriteOptions::new().compression(None).create(Cursor::new(Vec::new())).unwrap();
    let mut channel = |topic: &str| log.add_channel(0, topic, "json", &BTreeMap::new()).unwrap();
    let (episodes, decisions) = (channel("/episode"), channel("/decision"));
    let begin = r#"{"event":"begin","episode_id":"E1/a/s1/r1","model":"a","experiment":"E1","seed":1,"run":1,
        "body_color":"red","stated_color":null,"distractors":0}"#;
    let rows = (1..=3).map(|t| (decisions, format!(r#"{{"t":{t},"mirror_visible":false}}"#)));
    for (channel_id, text) in [(episodes, begin.to_owned())].into_iter().chain(rows) {
        let header = MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
        log.write_to_known_channel(&header, text.as_bytes()).unwrap();
    }
    log.finish().unwrap();
    let bytes = log.into_inner().into_inner();
    let third = bytes.windows(6).position(|window| window == br#"{"t":3"#).unwrap();
    let found = recovered(&bytes[..third]);
    assert_eq!(found.losses.episodes.len(), 1);
    let lost = &found.losses.episodes[0];
    assert_eq!((lost.episode_id.as_str(), lost.rows), ("E1/a/s1/r1", 2));
    assert!(lost.reason.contains("ends before the episode does") && found.losses.cut.is_some());
    // The complete log has no end of the episode either.
    assert_eq!(recovered(&bytes).losses.episodes[0].rows, 3);
}
