//! Reads a log as messages, one by one, in constant memory.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use serde_json::Value;

use super::error::LogError;
use super::message::{Decision, EpisodeMessage};
use super::messages::Messages;
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

pub struct LogReader(Messages<BufReader<File>>);

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

/// The hashes of a log's episodes by id, from their ends; logs of earlier versions have none.
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
pub fn png(image: &[u8]) -> Option<Vec<u8>> {
    #[derive(Clone, PartialEq, prost::Message)]
    struct Image {
        #[prost(bytes = "vec", tag = "2")]
        data: Vec<u8>,
    }
    let image = <Image as prost::Message>::decode(image).ok()?;
    (!image.data.is_empty()).then_some(image.data)
}
