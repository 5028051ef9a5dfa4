//! A log that ends too early, at any byte.

use super::logs::{Desk, RECORDING, ids, json, recovered};

/// That of the log cut at a byte every episode that had ended is there as it was, and the cut is told.
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
fn at_every_record_and_beside_it() {
    assert!(RECORDING.boundaries().len() > 20);
    for at in RECORDING.boundaries() {
        for at in [at - 1, at, at + 1, at + 9] {
            check(at.clamp(mcap::MAGIC.len(), RECORDING.log.len() - 1));
        }
    }
}

#[test]
fn at_fifty_bytes_here_and_there_by_the_program() {
    let desk = Desk::new();
    // A stride that is prime to most lengths visits the whole file, in no order.
    let length = RECORDING.log.len() - mcap::MAGIC.len();
    let places = (1..=50_usize).map(|nth| mcap::MAGIC.len() + nth * 7_368_787 % length);
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
fn what_is_lost_is_named() {
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
