//! A log with changed bytes.

use super::logs::{Desk, RECORDING, ids, json, recovered};
use crate::harness::files::fixture;

/// Every episode but one.
fn all_but(lost: usize) -> Vec<String> {
    let mut ids = RECORDING.ended(RECORDING.log.len());
    ids.remove(lost);
    ids
}

fn with_byte(at: usize, change: impl FnOnce(u8) -> u8) -> Vec<u8> {
    let mut bytes = RECORDING.log.clone();
    bytes[at] = change(bytes[at]);
    bytes
}

#[test]
fn a_flipped_byte_in_a_chunk_loses_that_episode_only() {
    let desk = Desk::new();
    for (lost, (start, end)) in RECORDING.chunks.iter().copied().enumerate() {
        let bytes = with_byte(usize::midpoint(start, end), |byte| byte ^ 0x10);
        let output = desk.recover(&bytes, &["--json"]);
        assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(desk.validated(), all_but(lost));
        assert_eq!(json(&output)["losses"]["damaged_chunks"], 1);
    }
}

/// Changes a bit of the log. Checks that only the episode with that byte is lost, that the others keep all values, and
/// that the damage is reported.
fn check(at: usize, bit: u32) {
    let whole = recovered(&RECORDING.log);
    let found = recovered(&with_byte(at, |byte| byte ^ (1 << bit)));
    let hit = RECORDING.chunks.iter().position(|(start, end)| (*start..*end).contains(&at));
    let kept: Vec<_> = whole.episodes.iter().filter(|episode| found.episodes.contains(episode)).cloned().collect();
    assert_eq!(kept, found.episodes, "byte {at}, bit {bit}: an episode that was not recorded");
    let may_be_lost = hit.map(|hit| whole.episodes[hit].episode_id.clone());
    for episode in whole.episodes.iter().filter(|episode| !kept.contains(episode)) {
        assert_eq!(Some(&episode.episode_id), may_be_lost.as_ref(), "byte {at}, bit {bit}: {:?}", found.losses);
    }
    assert!(found.losses.is_any(), "byte {at}, bit {bit}: the damage is not told");
}

#[test]
fn any_flipped_bit_outside_chunks_loses_no_episode() {
    let of_chunks = |at: &usize| RECORDING.chunks.iter().any(|(start, end)| (start + 64..*end).contains(at));
    // All lengths, opcodes and headers of records; elsewhere every 37th byte.
    let frames: Vec<usize> = RECORDING.boundaries().into_iter().flat_map(|at| at..at + 9).collect();
    let others = (mcap::MAGIC.len()..RECORDING.log.len()).step_by(37).filter(|at| !of_chunks(at));
    for (nth, at) in frames.into_iter().chain(others).enumerate() {
        if at < RECORDING.log.len() {
            check(at, u32::try_from(nth % 8).unwrap());
        }
    }
}

#[test]
fn any_flipped_bit_of_a_chunk_loses_at_most_its_episode() {
    for (start, end) in RECORDING.chunks.iter().copied() {
        let header = start..start + 64;
        for (nth, at) in header.chain((start + 64..end).step_by(61)).enumerate() {
            check(at, u32::try_from(nth % 8).unwrap());
        }
    }
}

#[test]
fn missing_extra_or_zeroed_bytes_lose_only_their_episode() {
    let (start, end) = RECORDING.chunks[1];
    let mut missing = RECORDING.log.clone();
    missing.drain(start + 100..start + 150);
    let mut more = RECORDING.log.clone();
    more.splice(end..end, *b"\x06 these are no records of any log");
    let mut zeros = RECORDING.log.clone();
    zeros[start..end].fill(0);
    assert_eq!(ids(&recovered(&missing)), all_but(1));
    assert_eq!(ids(&recovered(&zeros)), all_but(1));
    assert_eq!(ids(&recovered(&more)), RECORDING.ended(RECORDING.log.len()));
    assert!(recovered(&more).losses.is_any() && recovered(&zeros).losses.is_any());
}

#[test]
fn a_log_without_metadata_gives_a_trace_and_names_the_loss() {
    const METADATA: u8 = 0x0c;
    let place = RECORDING.first(METADATA);
    // The name comes after the frame and the name's length.
    let found = recovered(&with_byte(place + 9 + 4, |byte| byte ^ 0x20));
    assert_eq!(ids(&found).len(), 3);
    assert!(found.recording.is_none());
    assert!(found.losses.recording.unwrap().contains("cannot be replayed"));
}

#[test]
fn a_changed_value_in_the_metadata_is_named() {
    let text = RECORDING.log.windows(12).position(|window| window == b"\"world_hash\"").unwrap();
    let found = recovered(&with_byte(text + 15, |byte| if byte == b'0' { b'1' } else { b'0' }));
    assert_eq!(ids(&found).len(), 3);
    assert!(found.losses.damage[0].starts_with("the checksum of the data"), "{:?}", found.losses);
}

#[test]
fn the_episode_of_a_damaged_chunk_is_named_and_its_rows_are_dropped() {
    let mut bytes = std::fs::read(fixture("recorded/E1-guesser.mcap")).unwrap();
    let before = ids(&recovered(&bytes));
    let index = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes;
    let chunk = index.iter().min_by_key(|chunk| chunk.chunk_start_offset).unwrap();
    bytes[usize::try_from(chunk.chunk_start_offset + chunk.chunk_length / 2).unwrap()] ^= 1;
    let found = recovered(&bytes);
    assert_eq!(ids(&found), before[1..]);
    let named: Vec<_> = found.losses.episodes.iter().map(|lost| lost.episode_id.as_str()).collect();
    assert_eq!((named, found.losses.damaged_chunks), (vec![before[0].as_str()], 1));
}
