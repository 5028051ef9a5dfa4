//! The `.eval` archive of Inspect: one member per sample, or a folder of chunks.
//!
//! Rule: the JSON of a sample says its id, never the name of the member: ids may contain slashes.

use std::collections::{BTreeSet, HashSet};
use std::fs::File;
use std::io::{self, BufReader, Read as _};

use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use zip::{CompressionMethod, ZipArchive};

use super::Log;
use crate::error::ImportError;
use crate::json::{after_text, from_bytes};
use crate::rows::Rows;
use mirrorstats_exact::budget::{Budget, Exceeded, Limit};

const HEADERS: [&str; 2] = ["header.json", "_journal/start.json"];
const SAMPLES: &str = "samples/";
const SHELL: &str = "sample.json";
const SEQUENCES: [&str; 4] = ["messages", "calls", "events", "attachments"];
const HELP: &str = "copy the log again; `inspect log recover` mends one whose writer was ended";

const fn most_inflated(bytes: u64) -> Limit {
    Limit::new("bytes inflated from a log of its size", 96 << 20).and_beyond(1 << 20, 1024, bytes)
}

/// A value takes 72 bytes of memory, however short its text in the log is.
const fn most_values(bytes: u64) -> Limit {
    Limit::new("values of a sample of a log of its size", 2_000_000).and_beyond(1 << 20, 64, bytes)
}

pub(super) fn read(file: File, rows: &mut Rows<'_>) -> Result<(), ImportError> {
    let expected = "a log of Inspect, an archive with a directory at its end";
    let bytes = file.metadata().map_err(ImportError::read(&rows.file))?.len();
    let mut archive =
        EvalArchive::open(file, bytes).map_err(|error| rows.fault("", expected, error.to_string(), HELP))?;
    let header = HEADERS.into_iter().find(|name| archive.names.contains(*name));
    let header = header.ok_or_else(|| rows.fault("", expected, "neither `header.json` nor a journal", HELP))?;
    let mut head: Value = archive.json(header).map_err(|error| damaged(rows, header, &error))?;
    let mut log = Log::new(head["eval"].take());
    let (samples, strays) = archive.samples_and_strays();
    for name in &samples {
        archive.values = Budget::new(most_values(bytes));
        let sample = match folder(name) {
            Some(folder) => chunked(&mut archive, folder),
            None => archive.json(name),
        };
        let sample = sample.map_err(|error| damaged(rows, name, &error))?;
        log.add(sample, name, rows)?;
    }
    log.finish(&head["status"], rows);
    if let Some(first) = strays.first() {
        rows.notes.count(format!("members that are no samples, the first `{first}`"), strays.len() as u64);
    }
    Ok(())
}

fn damaged(rows: &Rows<'_>, name: &str, error: &io::Error) -> ImportError {
    match error.get_ref().and_then(|error| error.downcast_ref::<Exceeded>()) {
        Some(exceeded) => rows.over(name, exceeded),
        None => rows.fault(name, "JSON of Inspect", error.to_string(), HELP),
    }
}

/// Members of a zip archive: stored, deflated, or method 93 (zstd with any number of frames). The last of several
/// members with one name counts.
struct EvalArchive {
    zip: ZipArchive<BufReader<File>>,
    names: BTreeSet<String>,
    inflated: Budget,
    values: Budget,
}

impl EvalArchive {
    fn open(file: File, bytes: u64) -> io::Result<Self> {
        let zip = ZipArchive::new(BufReader::new(file))?;
        let names = zip.file_names().map(str::to_owned).collect();
        let (inflated, values) = (Budget::new(most_inflated(bytes)), Budget::new(most_values(bytes)));
        Ok(Self { zip, names, inflated, values })
    }

    /// The members that are samples or head the chunks of one, and those that the format does not know.
    fn samples_and_strays(&self) -> (Vec<String>, Vec<String>) {
        let folders = self.names.iter().filter_map(|name| folder(name));
        let parts: HashSet<&String> = folders.flat_map(|folder| self.parts(folder)).collect();
        let is_known = |name: &str| {
            ["header.json", "summaries.json", "reductions.json"].contains(&name) || name.starts_with("_journal/")
        };
        let others = self.names.iter().filter(|name| !parts.contains(name) && !is_known(name) && !name.ends_with('/'));
        others
            .cloned()
            .partition(|name| name.strip_prefix(SAMPLES).is_some_and(|rest| rest.strip_suffix(".json").is_some()))
    }

    /// The members of a chunked sample, but the one that heads it.
    fn parts(&self, folder: &str) -> impl Iterator<Item = &String> {
        self.names.range(folder.to_owned()..).take_while(move |name| name.starts_with(folder)).filter(move |name| {
            match name[folder.len()..].split_once('/') {
                None => ["metadata.json", "skeleton.json"].contains(&&name[folder.len()..]),
                Some(("events", "stats.json" | "uuids.json")) => true,
                Some((sequence, file)) => SEQUENCES.contains(&sequence) && start(file).is_some(),
            }
        })
    }

    fn json<T: DeserializeOwned>(&mut self, name: &str) -> io::Result<T> {
        let bytes = self.bytes(name)?;
        self.values.spend(values(&bytes))?;
        from_bytes(bytes)
    }

    fn bytes(&mut self, name: &str) -> io::Result<Vec<u8>> {
        let index = self.zip.index_for_name(name).ok_or(io::ErrorKind::NotFound)?;
        let raw = self.zip.by_index_raw(index)?;
        let (size, crc, mut bytes) = (raw.size(), raw.crc32(), Vec::new());
        self.inflated.spend(size)?;
        // One byte more, so that the end is reached, where the reader compares the checksum.
        if raw.compression() == CompressionMethod::ZSTD {
            zstd::Decoder::new(raw)?.take(size.saturating_add(1)).read_to_end(&mut bytes)?;
        } else {
            drop(raw);
            self.zip.by_index(index)?.take(size.saturating_add(1)).read_to_end(&mut bytes)?;
        }
        let found = crc32fast::hash(&bytes);
        if found == crc {
            Ok(bytes)
        } else {
            Err(io::Error::other(format!("checksum {found:08x} instead of {crc:08x}")))
        }
    }
}

/// The number of commas, and eight for each list and object: even small ones reserve memory for several items.
fn values(json: &[u8]) -> u64 {
    let (mut values, mut at) = (1, 0);
    while let Some(byte) = json.get(at) {
        at += 1;
        match byte {
            b'"' => at = after_text(json, at),
            b',' => values += 1,
            b'[' | b'{' => values += 8,
            _ => {}
        }
    }
    values
}

/// The folder of a chunked sample, by the member that heads it.
fn folder(name: &str) -> Option<&str> {
    let folder = name.strip_suffix(SHELL)?;
    folder.strip_prefix(SAMPLES).filter(|inner| inner.ends_with('/')).map(|_| folder)
}

/// The position of a chunk's first item, its name.
fn start(file: &str) -> Option<usize> {
    file.strip_suffix(".json")?.parse().ok()
}

fn chunked(archive: &mut EvalArchive, folder: &str) -> io::Result<Map<String, Value>> {
    let mut sample: Map<String, Value> = archive.json(&format!("{folder}{SHELL}"))?;
    let metadata = format!("{folder}metadata.json");
    if archive.names.contains(&metadata) {
        sample.insert("metadata".to_owned(), archive.json(&metadata)?);
    }
    let [messages, calls, events, attachments] = SEQUENCES.map(|name| sequence(archive, &format!("{folder}{name}/")));
    sample.insert("events_data".to_owned(), json!({ "messages": messages?, "calls": calls? }));
    sample.insert("events".to_owned(), events?.into());
    sample.insert("attachments".to_owned(), attachments?.into());
    Ok(sample)
}

fn sequence(archive: &mut EvalArchive, prefix: &str) -> io::Result<Vec<Value>> {
    let members = archive.names.range(prefix.to_owned()..).take_while(|member| member.starts_with(prefix));
    let mut chunks: Vec<_> =
        members.filter_map(|member| Some((start(&member[prefix.len()..])?, member.clone()))).collect();
    chunks.sort_unstable();
    let mut items = Vec::new();
    for (start, member) in chunks {
        if start != items.len() {
            return Err(io::Error::other(format!("no chunk `{prefix}{}.json`", items.len())));
        }
        items.extend(archive.json::<Vec<Value>>(&member)?);
    }
    Ok(items)
}
