//! Reads the messages of a log that must be complete, one by one, in constant memory.
//!
//! Rule: the first damage ends reading with an error that gives its place. Every length is compared with the rest of
//! the file before memory of that size is allocated.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use mcap::Message;
use mcap::read::ChannelAccumulator;
use mcap::records::Record;
use serde_json::Value;

use super::chunk::{Unpacked, inside};
use super::error::LogError;
use super::message::{Decision, EpisodeMessage};
use super::records::{RecordPiece, Records};
use super::topic;

#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    Episode(EpisodeMessage),
    /// The frame of a step: the bytes of a `foxglove.CompressedImage`.
    Frame(Vec<u8>),
    Census(Value),
    Decision(Box<Decision>),
    Other,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// ns; the step's `frame_time`.
    pub time: u64,
    pub event: Event,
}

pub struct LogReader(Messages);

impl LogReader {
    pub fn open(path: &Path) -> Result<Self, LogError> {
        Messages::open(path).map(Self)
    }
}

/// The id of an episode in a log that is not this one; `None` if there is no other.
pub fn other_episode(path: &Path, id: &str) -> Result<Option<String>, LogError> {
    for message in LogReader::open(path)? {
        if let Event::Episode(EpisodeMessage::Begin(head)) = message?.event
            && head.episode_id != id
        {
            return Ok(Some(head.episode_id));
        }
    }
    Ok(None)
}

/// The hashes of a log's episodes by id, from their ends; an episode without a hash is left out.
pub fn episode_hashes(path: &Path) -> Result<BTreeMap<String, String>, LogError> {
    let mut hashes = BTreeMap::new();
    for message in LogReader::open(path)? {
        if let Event::Episode(EpisodeMessage::End { episode_id, episode_hash: Some(hash), .. }) = message?.event {
            hashes.insert(episode_id, hash);
        }
    }
    Ok(hashes)
}

impl Iterator for LogReader {
    type Item = Result<Timed, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        let message = match self.0.next()? {
            Ok(message) => message,
            Err(error) => return Some(Err(error)),
        };
        let topic = &message.channel.topic;
        let event = event(topic, &message.data)
            .map_err(|fault| self.0.damaged(&format!("a message of {topic} cannot be read: {fault}")));
        Some(event.map(|event| Timed { time: message.log_time, event }))
    }
}

pub(super) fn event(name: &str, data: &[u8]) -> serde_json::Result<Event> {
    Ok(match name {
        topic::EPISODE => Event::Episode(serde_json::from_slice(data)?),
        topic::CENSUS => Event::Census(serde_json::from_slice(data)?),
        topic::DECISION => Event::Decision(Decision::parse(data)?.into()),
        topic::CAMERA => Event::Frame(data.to_vec()),
        _ => Event::Other,
    })
}

/// The PNG in a `foxglove.CompressedImage`; `None` without one.
#[cfg(any(feature = "sim", feature = "view"))]
pub fn png(image: &[u8]) -> Option<Vec<u8>> {
    let image = <foxglove::messages::CompressedImage as foxglove::Decode>::decode(image).ok()?;
    (!image.data.is_empty()).then(|| image.data.into())
}

/// The messages of a log up to its end record.
pub(super) struct Messages {
    path: PathBuf,
    records: Records<BufReader<File>>,
    channels: ChannelAccumulator<'static>,
    chunk: Unpacked,
    at: u64,
    has_ended: bool,
}

impl Messages {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let (records, channels) = (Records::open(path)?, ChannelAccumulator::default());
        Ok(Self { path: path.to_owned(), records, channels, chunk: Unpacked::default(), at: 0, has_ended: false })
    }

    pub(super) fn damaged(&self, fault: &str) -> LogError {
        let fault = format!("in the chunk at byte {}, {fault}", self.at);
        LogError::Damaged { file: self.path.display().to_string(), fault }
    }

    /// The next record that is not part of the index; `None` after the end record.
    fn record(&mut self) -> Result<Option<Record<'static>>, LogError> {
        loop {
            if let Some(record) = self.chunk.next() {
                return Ok(Some(record));
            }
            let fault = match self.records.next().map_err(LogError::io("read", &self.path))? {
                Some(RecordPiece::Record(Record::DataEnd(end))) => {
                    let (written, found) = (end.data_section_crc, self.records.checksum);
                    if written == 0 || written == found {
                        return Ok(None);
                    }
                    format!("the checksum of the data: expected {written:08x}, found {found:08x}")
                }
                Some(RecordPiece::Record(record)) => return Ok(Some(record)),
                Some(RecordPiece::Chunk(at, bytes)) => match inside(&bytes, &self.records.budgets) {
                    Ok(records) => {
                        (self.chunk, self.at) = (records, at);
                        continue;
                    }
                    Err(fault) => format!("the chunk at byte {at}: {fault}"),
                },
                Some(RecordPiece::Damage(fault) | RecordPiece::Cut(fault, _)) => fault,
                None => "it ends before its end record".to_owned(),
            };
            return Err(LogError::Damaged { file: self.path.display().to_string(), fault });
        }
    }

    fn message(&mut self) -> Result<Option<Message<'static>>, LogError> {
        while let Some(record) = self.record()? {
            match record {
                Record::Schema { header, data } => {
                    self.channels.add_schema(header, data).map_err(|fault| self.damaged(&fault.to_string()))?;
                }
                Record::Channel(channel) => {
                    self.channels.add_channel(channel).map_err(|fault| self.damaged(&fault.to_string()))?;
                }
                Record::Message { header, data } => {
                    let channel = self.channels.get(header.channel_id);
                    let channel = channel.ok_or_else(|| {
                        self.damaged(&format!("a message of no known channel: {}", header.channel_id))
                    })?;
                    let (sequence, log_time, publish_time) = (header.sequence, header.log_time, header.publish_time);
                    return Ok(Some(Message { channel, sequence, log_time, publish_time, data }));
                }
                _ => {}
            }
        }
        Ok(None)
    }
}

impl Iterator for Messages {
    type Item = Result<Message<'static>, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.has_ended {
            return None;
        }
        let message = self.message().transpose();
        self.has_ended = !matches!(message, Some(Ok(_)));
        message
    }
}
