//! A log as its messages, one after the other, in memory that does not grow with it.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use serde_json::Value;

use super::message::{Decision, EpisodeMessage};
use super::records::LONGEST;
use super::{LogError, topic};

/// What a message says.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// An episode begins or has ended.
    Episode(EpisodeMessage),
    /// The frame of a step: the bytes of a `foxglove.CompressedImage`.
    Frame(Vec<u8>),
    /// What the eye could see.
    Census(Value),
    /// The row of a step.
    Decision(Box<Decision>),
    /// Any other message.
    Other,
}

/// A message and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Timed {
    /// ns; the step's `frame_time`.
    pub time: u64,
    /// What it says.
    pub event: Event,
}

/// The messages of a log.
pub struct LogReader<R: Read> {
    path: PathBuf,
    messages: MessageReader<R>,
}

impl LogReader<BufReader<File>> {
    /// Opens a log.
    ///
    /// # Errors
    /// When the file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let file = File::open(path).map_err(LogError::io("open", path))?;
        Ok(Self::new(path, BufReader::new(file)))
    }
}

/// An episode of a log that is not the one of this id; `None` if there is none.
///
/// # Errors
/// When the log cannot be read to its end.
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

impl<R: Read> LogReader<R> {
    /// The messages in these bytes; `path` is for messages of errors.
    pub fn new(path: &Path, bytes: R) -> Self {
        let options =
            LinearReaderOptions::default().with_prevalidate_chunk_crcs(true).with_record_length_limit(LONGEST);
        Self { path: path.to_owned(), messages: MessageReader::new_with_options(bytes, options) }
    }
}

impl<R: Read> Iterator for LogReader<R> {
    type Item = Result<Timed, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        let message = match self.messages.next()? {
            Ok(message) => message,
            Err(error) => return Some(Err(LogError::reading(&self.path)(error))),
        };
        let event = event(&message.channel.topic, &message.data).map_err(|fault| LogError::Damaged {
            file: self.path.display().to_string(),
            fault: format!("a message of {}: {fault}", message.channel.topic),
        });
        Some(event.map(|event| Timed { time: message.log_time, event }))
    }
}

/// What a message of a topic says.
pub(super) fn event(name: &str, data: &[u8]) -> serde_json::Result<Event> {
    Ok(match name {
        topic::EPISODE => Event::Episode(serde_json::from_slice(data)?),
        topic::CENSUS => Event::Census(serde_json::from_slice(data)?),
        topic::DECISION => Event::Decision(serde_json::from_slice(data)?),
        topic::CAMERA => Event::Frame(data.to_vec()),
        _ => Event::Other,
    })
}

/// The PNG in a `foxglove.CompressedImage`; `None` if there is none.
pub fn png(image: &[u8]) -> Option<Vec<u8>> {
    /// As much of the message as is needed.
    #[derive(Clone, PartialEq, prost::Message)]
    struct Image {
        #[prost(bytes = "vec", tag = "2")]
        data: Vec<u8>,
    }
    let image = <Image as prost::Message>::decode(image).ok()?;
    (!image.data.is_empty()).then_some(image.data)
}
