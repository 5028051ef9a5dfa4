//! What can be saved of a log that was cut off or damaged.
//!
//! Rule: an episode is saved if its `begin`, its `end` and every row between are there; anything else that was begun is
//! lost, and named. What is behind a damaged chunk is still looked at; what is behind a damaged record is not, since
//! nothing says where the next one begins.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use mcap::read::{ChunkReader, LinearReader, Options};
use mcap::records::Record;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use super::message::{EpisodeMessage, Head};
use super::read::{Event, event};
use super::{LogError, METADATA, METADATA_KEY};
use crate::trace::episode::{Episode, Step};

/// What was saved of a log, and what was not.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recovered {
    /// The episodes that are whole, in the order of the log.
    pub episodes: Vec<Episode>,
    /// How the recording was made, if the log still says so.
    pub recording: Option<Value>,
    /// What is lost.
    pub losses: Losses,
}

/// What is lost of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Losses {
    /// Episodes that were begun and are not whole.
    pub episodes: Vec<LostEpisode>,
    /// Rows that belong to no episode whose begin is there.
    pub stray_rows: usize,
    /// Chunks that cannot be read.
    pub damaged_chunks: usize,
    /// Why reading ended before the end of the log, if it did.
    pub cut: Option<String>,
}

/// An episode that is not whole.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LostEpisode {
    /// Its id.
    pub episode_id: String,
    /// The rows that are there.
    pub rows: usize,
    /// What is missing.
    pub reason: String,
}

impl Losses {
    /// Whether anything is.
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }
}

/// Saves what can be saved of the log at `path`.
///
/// # Errors
/// When the file cannot be read, or does not begin as a log.
pub fn recover(path: &Path) -> Result<Recovered, LogError> {
    let bytes = fs::read(path).map_err(LogError::io("read", path))?;
    if !bytes.starts_with(mcap::MAGIC) {
        let fault = "it does not begin as an MCAP file does".to_owned();
        return Err(LogError::Foreign { file: path.display().to_string(), fault });
    }
    Ok(of_bytes(&bytes))
}

/// Saves what can be saved of the bytes of a log.
pub fn of_bytes(bytes: &[u8]) -> Recovered {
    let mut salvage = Salvage { channels: channels(bytes), ..Salvage::default() };
    let mut has_ended = false;
    for record in records(bytes) {
        match record {
            Ok(Record::DataEnd(_)) => {
                has_ended = true;
                break;
            }
            Ok(Record::Chunk { header, data }) => salvage.chunk(header, &data),
            Ok(Record::Message { header, data }) => salvage.message(header.channel_id, &data),
            Ok(Record::Metadata(metadata)) if metadata.name == METADATA => {
                let text = metadata.metadata.get(METADATA_KEY);
                salvage.result.recording = text.and_then(|text| serde_json::from_str(text).ok());
            }
            Ok(_) => {}
            Err(fault) => {
                salvage.result.losses.cut = Some(fault);
                has_ended = true;
                break;
            }
        }
    }
    salvage.close("the log ends before the episode does");
    if !has_ended {
        salvage.result.losses.cut = Some("the log ends before its end record".to_owned());
    }
    salvage.result
}

/// The records of the bytes up to the first that cannot be read, chunks whole.
fn records(bytes: &[u8]) -> impl Iterator<Item = Result<Record<'_>, String>> {
    let (reader, fault) = match LinearReader::new_with_options(bytes, Options::IgnoreEndMagic.into()) {
        Ok(reader) => (Some(reader), None),
        Err(fault) => (None, Some(Err(fault.to_string()))),
    };
    reader.into_iter().flatten().map(|record| record.map_err(|fault| fault.to_string())).chain(fault)
}

fn inside(header: mcap::records::ChunkHeader, data: &[u8]) -> Result<Vec<Record<'static>>, String> {
    let reader = ChunkReader::new(header, data).map_err(|fault| fault.to_string())?;
    reader.map(|record| record.map(Record::into_owned).map_err(|fault| fault.to_string())).collect()
}

/// The topics by channel, from wherever the bytes still say them: a later chunk does not repeat an earlier one's.
fn channels(bytes: &[u8]) -> BTreeMap<u16, String> {
    let mut found = BTreeMap::new();
    for record in records(bytes).map_while(Result::ok) {
        match record {
            Record::Channel(channel) => {
                found.insert(channel.id, channel.topic);
            }
            Record::Chunk { header, data } => {
                let inner = inside(header, &data).unwrap_or_default();
                found.extend(inner.into_iter().filter_map(|record| match record {
                    Record::Channel(channel) => Some((channel.id, channel.topic)),
                    _ => None,
                }));
            }
            _ => {}
        }
    }
    found
}

/// The episode that is being put together.
#[derive(Default)]
struct Salvage {
    channels: BTreeMap<u16, String>,
    open: Option<(Head, Vec<Step>, Option<String>)>,
    result: Recovered,
}

impl Salvage {
    fn chunk(&mut self, header: mcap::records::ChunkHeader, data: &[u8]) {
        match inside(header, data) {
            Err(_) => {
                self.result.losses.damaged_chunks += 1;
                self.close("a chunk with its rows is damaged");
            }
            Ok(records) => {
                for record in records {
                    if let Record::Message { header, data } = record {
                        self.message(header.channel_id, &data);
                    }
                }
            }
        }
    }

    fn message(&mut self, channel: u16, data: &[u8]) {
        let Some(topic) = self.channels.get(&channel) else { return };
        match event(topic, data) {
            Ok(Event::Episode(EpisodeMessage::Begin(head))) => {
                self.close("the next episode begins before its end");
                self.open = Some((head, Vec::new(), None));
            }
            Ok(Event::Episode(EpisodeMessage::End { episode_id, steps })) => self.end(&episode_id, steps),
            Ok(Event::Decision(row)) => {
                let Some((_, rows, fault)) = &mut self.open else {
                    self.result.losses.stray_rows += 1;
                    return;
                };
                let expected = rows.len() + 1;
                if usize::try_from(row.t) != Ok(expected) {
                    fault.get_or_insert(format!("expected the row of step {expected}, found that of step {}", row.t));
                }
                match row.into_step() {
                    Ok(step) => rows.push(step),
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

    fn end(&mut self, episode_id: &str, steps: usize) {
        match self.open.take() {
            Some((head, rows, None)) if head.episode_id == episode_id && rows.len() == steps && steps > 0 => {
                self.result.episodes.push(head.with_steps(rows));
            }
            Some((head, rows, fault)) => {
                let reason = fault.unwrap_or_else(|| format!("its end says {steps} rows of `{episode_id}`"));
                self.lose(head.episode_id, rows.len(), reason);
            }
            // Its begin was in a damaged chunk.
            None => self.lose(episode_id.to_owned(), 0, "its begin is not there".to_owned()),
        }
    }

    /// What is open now will not be whole.
    fn close(&mut self, reason: &str) {
        if let Some((head, rows, fault)) = self.open.take() {
            self.lose(head.episode_id, rows.len(), fault.unwrap_or_else(|| reason.to_owned()));
        }
    }

    fn lose(&mut self, episode_id: String, rows: usize, reason: String) {
        self.result.losses.episodes.push(LostEpisode { episode_id, rows, reason });
    }
}
