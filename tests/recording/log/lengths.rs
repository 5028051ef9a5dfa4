//! A log with one wrong length: an error or a named loss, whatever the length, and little memory.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Cursor;
use std::path::Path;
use std::process::Output;

use mcap::records::{Metadata, op};
use mirrorstats_log::{METADATA, METADATA_KEY};

use super::logs::{RECORDING, SHORT, ids, recovered};
use crate::harness::files::write_small_world;
use crate::harness::program::{self, stderr};

/// The bytes of an opcode and a length.
const FRAME: usize = 9;

/// A length or a file position in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Field {
    at: usize,
    /// Its size in bytes: 4 or 8.
    size: usize,
    what: &'static str,
}

/// Reads through a record.
struct Walk<'a> {
    log: &'a [u8],
    at: usize,
    fields: &'a mut BTreeSet<Field>,
}

impl Walk<'_> {
    fn number(&mut self, size: usize, what: &'static str) -> usize {
        self.fields.insert(Field { at: self.at, size, what });
        let number = read(self.log, self.at, size);
        self.at += size;
        number
    }

    fn text(&mut self, what: &'static str) {
        self.at += self.number(4, what);
    }
}

fn read(log: &[u8], at: usize, size: usize) -> usize {
    let mut bytes = [0; 8];
    bytes[..size].copy_from_slice(&log[at..at + size]);
    usize::try_from(u64::from_le_bytes(bytes)).unwrap()
}

/// The length fields of the records from `from` to `to`; of messages, only the first ones.
fn fields(log: &[u8], from: usize, to: usize, found: &mut BTreeSet<Field>) {
    let (mut at, mut messages) = (from, 0);
    while at < to {
        let opcode = log[at];
        messages += usize::from(opcode == op::MESSAGE);
        let length = read(log, at + 1, 8);
        if opcode != op::MESSAGE || messages <= 4 {
            found.insert(Field { at: at + 1, size: 8, what: "record" });
            of_record(opcode, Walk { log, at: at + FRAME, fields: found });
        }
        at += FRAME + length;
    }
    assert_eq!(at, to);
}

fn of_record(opcode: u8, mut walk: Walk<'_>) {
    match opcode {
        op::HEADER => {
            walk.text("profile");
            walk.text("library");
        }
        op::FOOTER => {
            walk.number(8, "start of the index");
            walk.number(8, "start of the offsets");
        }
        op::SCHEMA => {
            walk.at += 2;
            walk.text("schema name");
            walk.text("schema encoding");
            walk.text("schema data");
        }
        op::CHANNEL => {
            walk.at += 4;
            walk.text("topic");
            walk.text("message encoding");
            walk.number(4, "map of a channel");
        }
        op::CHUNK => {
            walk.at += 16;
            walk.number(8, "chunk unpacked");
            walk.at += 4;
            let is_plain = read(walk.log, walk.at, 4) == 0;
            walk.text("compression");
            let packed = walk.number(8, "chunk packed");
            if is_plain {
                fields(walk.log, walk.at, walk.at + packed, walk.fields);
            }
        }
        op::MESSAGE_INDEX => {
            walk.at += 2;
            walk.number(4, "message index");
        }
        op::CHUNK_INDEX => {
            walk.at += 16;
            walk.number(8, "start of a chunk");
            walk.number(8, "length of a chunk");
            walk.text("map of message indexes");
            walk.number(8, "length of message indexes");
            walk.text("compression of a chunk");
            walk.number(8, "packed size of a chunk");
            walk.number(8, "unpacked size of a chunk");
        }
        op::STATISTICS => {
            walk.at += 42;
            walk.number(4, "map of counts");
        }
        op::METADATA => {
            walk.text("metadata name");
            walk.number(4, "metadata map");
            walk.text("metadata key");
            walk.text("metadata value");
        }
        op::METADATA_INDEX => {
            walk.number(8, "start of metadata");
            walk.number(8, "length of metadata");
            walk.text("name of metadata");
        }
        op::SUMMARY_OFFSET => {
            walk.at += 1;
            walk.number(8, "start of a group");
            walk.number(8, "length of a group");
        }
        _ => {}
    }
}

fn fields_of(log: &[u8]) -> Vec<Field> {
    let mut found = BTreeSet::new();
    fields(log, mcap::MAGIC.len(), log.len() - mcap::MAGIC.len(), &mut found);
    found.into_iter().collect()
}

/// The logs with this field set to each of the test values.
fn damaged(log: &[u8], field: Field) -> Vec<(String, Vec<u8>)> {
    let own = read(log, field.at, field.size) as u64;
    let values: &[u64] = &[1 << 63, 1 << 54, u64::from(u32::MAX), 1 << 29, 0, own + 1];
    let fits = |value: &&u64| field.size == 8 || u32::try_from(**value).is_ok();
    let changed = values.iter().filter(fits).filter(|value| **value != own).map(|value| {
        let mut bytes = log.to_vec();
        bytes[field.at..field.at + field.size].copy_from_slice(&value.to_le_bytes()[..field.size]);
        (format!("{} at byte {}: {value} instead of {own}", field.what, field.at), bytes)
    });
    changed.collect()
}

/// Runs the program with 512 MB of memory.
fn limited(folder: &Path, words: &str) -> Output {
    program::limited(folder, "ulimit -v 524288").args(words.split(' ')).output().unwrap()
}

/// The recording's log with uncompressed chunks.
fn plain() -> Vec<u8> {
    let options = mcap::WriteOptions::new().profile("").library("x").compression(None).chunk_size(None);
    let mut out = options.create(Cursor::new(Vec::new())).unwrap();
    let recording = recovered(&RECORDING.log).recording.unwrap().to_string();
    let metadata = BTreeMap::from([(METADATA_KEY.to_owned(), recording)]);
    out.write_metadata(&Metadata { name: METADATA.to_owned(), metadata }).unwrap();
    for message in mcap::MessageStream::new(&RECORDING.log).unwrap() {
        let message = message.unwrap();
        out.write(&message).unwrap();
        if message.data.starts_with(br#"{"event":"end""#) {
            out.flush().unwrap();
        }
    }
    out.finish().unwrap();
    out.into_inner().into_inner()
}

/// Recovers every `stride`-th of the logs with one wrong length, with the program.
#[cfg(unix)]
fn check_recover(stride: usize) {
    let folder = tempfile::tempdir().unwrap();
    let mut count = 0;
    let logs = fields_of(&RECORDING.log).into_iter().flat_map(|field| damaged(&RECORDING.log, field));
    for (what, bytes) in logs.step_by(stride) {
        fs::write(folder.path().join("log.mcap"), bytes).unwrap();
        let output = limited(folder.path(), "trace recover log.mcap -o trace.parquet");
        assert_eq!(output.status.code(), Some(3), "{what}: {}", stderr(&output));
        assert_eq!(stderr(&output), "", "{what}");
        drop(fs::remove_file(folder.path().join("trace.parquet")));
        count += 1;
    }
    assert!(count > 250 / stride, "{count} lengths were changed");
}

#[cfg(unix)]
#[test]
fn recover_names_the_losses_by_a_bad_length() {
    // A prime, so that every kind of value occurs.
    check_recover(7);
}

#[cfg(unix)]
#[test]
#[ignore = "soak: all lengths, each with up to six values"]
fn soak_recover_names_the_losses_by_a_bad_length() {
    check_recover(1);
}

#[test]
fn lengths_within_a_chunk_lose_no_episode_but_its_own() {
    let log = plain();
    let whole = recovered(&log);
    assert_eq!((ids(&whole).len(), whole.losses.is_any()), (3, false));
    let mut count = 0;
    for field in fields_of(&log) {
        for (what, bytes) in damaged(&log, field) {
            let found = recovered(&bytes);
            assert!(found.episodes.len() >= 2, "{what}: {:?}", found.losses);
            assert!(found.episodes.iter().all(|episode| whole.episodes.contains(episode)), "{what}");
            assert!(found.losses.is_any(), "{what}");
            count += 1;
        }
    }
    assert!(count > 250, "{count} lengths were changed");
}

#[test]
fn a_bad_length_is_harmless_without_checksums() {
    let mut log = plain();
    for field in fields_of(&log) {
        // The checksum of a chunk follows its size. The end record holds only the data's checksum.
        if field.what == "chunk unpacked" || (field.what == "record" && log[field.at - 1] == op::DATA_END) {
            log[field.at + 8..field.at + 12].fill(0);
        }
    }
    // The index's checksum ends the footer.
    let behind = log.len() - mcap::MAGIC.len();
    log[behind - 4..behind].fill(0);
    let whole = recovered(&log);
    for field in fields_of(&log) {
        for (what, bytes) in damaged(&log, field) {
            let found = recovered(&bytes);
            assert!(found.losses.is_any() || found == whole, "{what}");
        }
    }
}

#[cfg(unix)]
#[test]
fn a_log_with_a_bad_length_is_not_continued() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    fs::create_dir(&runs).unwrap();
    write_small_world(folder.path(), SHORT);
    fs::write(runs.join("E1-random.parquet"), &RECORDING.trace).unwrap();
    let words = "record --config small.toml --out runs --agent random --experiment E1 --seeds 1 --runs 4 --no-frames";
    for field in fields_of(&RECORDING.log) {
        let Some((what, bytes)) = damaged(&RECORDING.log, field).into_iter().next() else { continue };
        fs::write(runs.join("E1-random.mcap"), &bytes).unwrap();
        let output = limited(folder.path(), words);
        assert_eq!(output.status.code(), Some(2), "{what}: {}", stderr(&output));
        assert!(
            stderr(&output).starts_with("error: the log `runs/E1-random.mcap` is damaged: "),
            "{}",
            stderr(&output)
        );
        assert!(fs::read(runs.join("E1-random.mcap")).unwrap() == bytes, "{what}: the log was changed");
        assert_eq!(fs::read_dir(&runs).unwrap().count(), 2, "{what}: something was left behind");
    }
}

#[cfg(unix)]
#[test]
fn a_pending_episode_with_a_bad_log_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("runs/.parts");
    fs::create_dir_all(&parts).unwrap();
    write_small_world(folder.path(), SHORT);
    let words = "record --config small.toml --out runs --agent random --experiment E1 --seeds 1 --runs 3 --no-frames";
    fs::write(parts.join("E1-random-s1-r1.parquet"), one_episode()).unwrap();
    let chunk = fields_of(&RECORDING.log).into_iter().find(|field| field.what == "chunk packed").unwrap();
    for (what, bytes) in damaged(&RECORDING.log, chunk) {
        fs::write(parts.join("E1-random-s1-r1.mcap"), bytes).unwrap();
        let output = limited(folder.path(), words);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{what}: {said}");
        assert!(said.contains("E1-random-s1-r1.mcap` is damaged: ") && said.contains("byte "), "{what}: {said}");
        assert!(said.contains("help: remove it and `") && said.contains("E1-random-s1-r1.parquet`;"), "{what}: {said}");
    }
    // The advice in the message works.
    for name in ["E1-random-s1-r1.mcap", "E1-random-s1-r1.parquet"] {
        fs::remove_file(parts.join(name)).unwrap();
    }
    let output = limited(folder.path(), words);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(fs::read(folder.path().join("runs/E1-random.mcap")).unwrap() == RECORDING.log);
    assert!(fs::read(folder.path().join("runs/E1-random.parquet")).unwrap() == RECORDING.trace);
}

/// The trace of the first episode alone, in the form of a part.
#[cfg(unix)]
fn one_episode() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    write_small_world(folder.path(), SHORT);
    let words = "record --config small.toml --out runs --agent random --experiment E1 --seeds 1 --runs 1 --no-frames";
    let output = limited(folder.path(), words);
    assert!(output.status.success(), "{}", stderr(&output));
    fs::read(folder.path().join("runs/E1-random.parquet")).unwrap()
}
