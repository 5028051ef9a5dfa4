//! Recovers a truncated or damaged log.
//!
//! Rule: an episode is saved if its `begin`, its `end` and all rows between are there, and the hash in `end` matches
//! them. Other episodes are lost, and named. Data after damage is still read. Chunks with a bad checksum are discarded,
//! so that saved data is what was written.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;

use mcap::records::{Metadata, Record};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::chunk::{Budgets, glimpse, inside};
use super::error::LogError;
use super::message::EpisodeMessage;
use super::read::{Event, event};
use super::records::{RecordPiece, Records};
use super::{METADATA, METADATA_KEY, topic};
use mirrorstats_exact::budget::{Budget, Limit, SETTING};
use mirrorstats_exact::format::counted;
use mirrorstats_exact::input;
use mirrorstats_trace::episodes::episode::{Episode, Step};
use mirrorstats_trace::episodes::episode_hash;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recovered {
    /// The episodes that are whole, in the order of the log.
    pub episodes: Vec<Episode>,
    /// The metadata of the recording, if the log still has it.
    pub recording: Option<Value>,
    pub losses: Losses,
}

/// The losses of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Losses {
    /// Episodes that were begun and are not whole.
    pub episodes: Vec<PartialEpisode>,
    /// Rows that belong to no episode whose begin is there.
    pub stray_rows: usize,
    /// Chunks that cannot be read.
    pub damaged_chunks: usize,
    /// Damage beside chunks: unreadable records, bad checksums.
    pub damage: Vec<String>,
    /// The reason why the log does not say any more how it was recorded, if it does not.
    pub recording: Option<String>,
    /// The reason why reading ended before the end of the log, if it did.
    pub cut: Option<String>,
}

/// An episode that is not whole.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[schemars(rename = "LostEpisode")]
pub struct PartialEpisode {
    /// Its id.
    pub episode_id: String,
    /// The rows that are there.
    pub rows: usize,
    /// The missing part.
    pub reason: String,
}

impl Losses {
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }

    pub fn first(&self) -> Option<String> {
        let episode = self.episodes.first().map(|lost| format!("the episode `{}`: {}", lost.episode_id, lost.reason));
        let damage = self.damage.first().or(self.cut.as_ref()).or(self.recording.as_ref()).cloned();
        let counts = || {
            let [chunks, rows] = [(self.damaged_chunks, "damaged chunk"), (self.stray_rows, "row")];
            format!("{}, {} of no episode", counted(chunks.0 as u64, chunks.1), counted(rows.0 as u64, rows.1))
        };
        episode.or(damage).or_else(|| self.is_any().then(counts))
    }
}

pub fn recover(path: &Path) -> Result<Recovered, LogError> {
    let file = input::open(path).map_err(LogError::io("open", path))?;
    recover_from(path, BufReader::new(file))
}

/// Recovers the readable part of a log in these bytes; `path` is for error messages.
pub fn recover_from(path: &Path, bytes: impl Read + Seek) -> Result<Recovered, LogError> {
    let mut records = Records::from_reader(path, bytes)?;
    let salvage = Salvage::read(&mut records).map_err(LogError::io("read", path))?;
    let is_ours = salvage.channels.values().any(|found| found == topic::EPISODE);
    if !is_ours && !salvage.result.losses.is_any() {
        let fault = "it has no topic /episode; `mirrorstats record` writes logs that do".to_owned();
        return Err(LogError::Foreign { file: path.display().to_string(), fault });
    }
    Ok(salvage.finished())
}

struct Salvage {
    channels: BTreeMap<u16, String>,
    open: Option<(Episode, Vec<Step>, Option<String>)>,
    rows: Budget,
    result: Recovered,
}

impl Salvage {
    fn read(records: &mut Records<impl Read + Seek>) -> io::Result<Self> {
        // A chunk does not repeat the channels of earlier chunks, which may be damaged; the summary does.
        let topic =
            |record| if let Record::Channel(channel) = record { Some((channel.id, channel.topic)) } else { None };
        let channels = records.summary()?.into_iter().filter_map(topic).collect();
        // Saved rows are kept in memory, where a row takes far more than one of few words in a chunk. Logs in use have
        // some hundred bytes per row, without its frame.
        let rows = Budget::new(Limit::new("rows in a log of its size", 200_000 + records.end / 8));
        let mut salvage = Self { channels, open: None, rows, result: Recovered::default() };
        let mut is_open = true;
        while let Some(piece) = records.next()? {
            match piece {
                RecordPiece::Record(Record::DataEnd(end)) => {
                    is_open = false;
                    salvage.compare("the data", end.data_section_crc, records.checksum);
                    salvage.index(records)?;
                    break;
                }
                RecordPiece::Record(record) => salvage.record(record),
                RecordPiece::Chunk(at, chunk) => salvage.chunk(at, &chunk, &records.budgets),
                RecordPiece::Damage(fault) => salvage.result.losses.damage.push(fault),
                RecordPiece::Cut(fault, tail) => {
                    salvage.close("the log ends before the episode does");
                    salvage.lose_all(&tail, &records.budgets, "the log ends before the episode does");
                    salvage.result.losses.cut = Some(fault);
                }
            }
        }
        if is_open && salvage.result.losses.cut.is_none() {
            salvage.result.losses.cut = Some("the log ends before its end record".to_owned());
        }
        Ok(salvage)
    }

    fn index(&mut self, records: &mut Records<impl Read + Seek>) -> io::Result<()> {
        while let Some(piece) = records.next()? {
            match piece {
                RecordPiece::Record(Record::Footer(footer)) => {
                    self.compare("the index", footer.summary_crc, records.checksum);
                    if !records.is_closed()? {
                        self.result.losses.damage.push("the log does not end as an MCAP file does".to_owned());
                    }
                    return Ok(());
                }
                RecordPiece::Record(_) | RecordPiece::Chunk(..) => {}
                RecordPiece::Damage(fault) => self.result.losses.damage.push(fault),
                RecordPiece::Cut(..) => break,
            }
        }
        self.result.losses.cut = Some("the log ends within its index, behind all that was recorded".to_owned());
        Ok(())
    }

    /// Compares a checksum with the written one; 0 means none.
    fn compare(&mut self, what: &str, written: u32, found: u32) {
        let losses = &mut self.result.losses;
        if written != 0 && written != found && losses.damaged_chunks == 0 && losses.damage.is_empty() {
            losses.damage.push(format!("the checksum of {what}: expected {written:08x}, found {found:08x}"));
        }
    }

    fn record(&mut self, record: Record<'static>) {
        match record {
            Record::Message { header, data } => self.message(header.channel_id, &data),
            Record::Channel(channel) => drop(self.channels.insert(channel.id, channel.topic)),
            Record::Metadata(metadata) if metadata.name == METADATA => self.recording(&metadata),
            _ => {}
        }
    }

    fn recording(&mut self, metadata: &Metadata) {
        let text = metadata.metadata.get(METADATA_KEY);
        self.result.recording = text.and_then(|text| serde_json::from_str(text).ok());
    }

    fn chunk(&mut self, at: u64, chunk: &[u8], budgets: &Budgets) {
        match inside(chunk, budgets) {
            Err(fault) => {
                self.result.losses.damaged_chunks += 1;
                if fault.contains(SETTING) {
                    self.result.losses.damage.push(format!("the chunk at byte {at} is not unpacked: {fault}"));
                }
                self.close(&format!("a chunk with its rows is damaged, at byte {at}: {fault}"));
                self.lose_all(chunk, budgets, &format!("its chunk is damaged, at byte {at}: {fault}"));
            }
            Ok(records) => records.for_each(|record| self.record(record)),
        }
    }

    /// Names the episodes that begin in a damaged chunk, as far as it is readable.
    fn lose_all(&mut self, chunk: &[u8], budgets: &Budgets, reason: &str) {
        for record in glimpse(chunk, budgets) {
            match record {
                Record::Channel(channel) => drop(self.channels.entry(channel.id).or_insert(channel.topic)),
                Record::Message { header, data } => {
                    let topic = self.channels.get(&header.channel_id).map_or("", String::as_str);
                    match (event(topic, &data), &mut self.open) {
                        (Ok(Event::Episode(EpisodeMessage::Begin(head))), open) => {
                            *open = Some((*head, Vec::new(), None));
                        }
                        (Ok(Event::Decision(row)), Some((_, rows, _))) if self.rows.spend(1).is_ok() => {
                            rows.extend(row.into_step());
                        }
                        _ => {}
                    }
                }
                _ => {}
            }
        }
        self.close(reason);
    }

    fn finished(mut self) -> Recovered {
        self.close("the log ends before the episode does");
        if self.result.recording.is_none() {
            let words = format!("no metadata `{METADATA}` can be read: the trace cannot be replayed");
            self.result.losses.recording = Some(words);
        }
        self.result
    }

    fn message(&mut self, channel: u16, data: &[u8]) {
        let Some(topic) = self.channels.get(&channel) else { return };
        match event(topic, data) {
            Ok(Event::Episode(EpisodeMessage::Begin(head))) => {
                self.close("the next episode begins before its end");
                self.open = Some((*head, Vec::new(), None));
            }
            Ok(Event::Episode(EpisodeMessage::End { episode_id, steps, fingerprint, episode_hash })) => {
                self.end(&episode_id, steps, (fingerprint, episode_hash));
            }
            Ok(Event::Decision(row)) => {
                let Some((_, rows, fault)) = &mut self.open else {
                    self.result.losses.stray_rows += 1;
                    return;
                };
                let expected = rows.len() + 1;
                if usize::try_from(row.t) != Ok(expected) {
                    fault.get_or_insert(format!("expected the row of step {expected}, found that of step {}", row.t));
                }
                match row.into_step().map(|step| self.rows.spend(1).map(|()| rows.push(step))) {
                    Ok(Ok(())) => {}
                    Ok(Err(exceeded)) => drop(fault.get_or_insert(exceeded.to_string())),
                    Err(error) => drop(fault.get_or_insert(error.to_string())),
                }
            }
            Ok(_) => {}
            Err(error) => {
                if let Some((_, _, fault)) = &mut self.open {
                    fault.get_or_insert(format!("a message of {topic} cannot be read: {error}"));
                }
            }
        }
    }

    fn end(&mut self, episode_id: &str, steps: usize, (fingerprint, hash): (Option<String>, Option<String>)) {
        match self.open.take() {
            Some((head, rows, None)) if head.episode_id == episode_id && rows.len() == steps && steps > 0 => {
                match ended(head, rows, fingerprint, hash) {
                    Ok(episode) => self.result.episodes.push(episode),
                    Err((episode, reason)) => self.lose(episode.episode_id, episode.steps.len(), reason),
                }
            }
            Some((head, rows, fault)) => {
                let reason = fault.unwrap_or_else(|| format!("its end says {steps} rows of `{episode_id}`"));
                self.lose(head.episode_id, rows.len(), reason);
            }
            // Its begin was in a damaged chunk.
            None => self.lose(episode_id.to_owned(), 0, "its begin is not there".to_owned()),
        }
    }

    fn close(&mut self, reason: &str) {
        if let Some((head, rows, fault)) = self.open.take() {
            self.lose(head.episode_id, rows.len(), fault.unwrap_or_else(|| reason.to_owned()));
        }
    }

    fn lose(&mut self, episode_id: String, rows: usize, reason: String) {
        self.result.losses.episodes.push(PartialEpisode { episode_id, rows, reason });
    }
}

/// The episode with its rows and the contents of its end message.
pub fn ended(
    head: Episode,
    steps: Vec<Step>,
    fingerprint: Option<String>,
    hash: Option<String>,
) -> Result<Episode, (Box<Episode>, String)> {
    let fingerprint = fingerprint.or_else(|| head.fingerprint.clone());
    let episode = Episode { steps, fingerprint, episode_hash: None, ..head };
    let Some(stated) = hash else { return Ok(episode) };
    let found = episode_hash::hash_of(&episode);
    if found == stated {
        return Ok(Episode { episode_hash: Some(stated), ..episode });
    }
    let reason = format!("its rows do not match its end: expected the hash {stated}, found {found}");
    Err((Box::new(episode), reason))
}
