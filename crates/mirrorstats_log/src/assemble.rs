//! Merges several logs into one: episodes in the order of the trace, each in its own chunks.

use std::collections::BTreeMap;
#[cfg(feature = "view")]
use std::collections::BTreeSet;
use std::io::{BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use mcap::records::Metadata;
use mcap::{Compression, Message, WriteOptions, Writer};
use serde_json::Value;

use super::error::LogError;
use super::message::EpisodeMessage;
use super::read::Messages;
use super::{METADATA, METADATA_KEY, topic};
use mirrorstats_exact::replace::NewFile;
#[cfg(feature = "view")]
use mirrorstats_exact::replace::folder_of;
use mirrorstats_trace::episodes::episode::Episode;

/// The order of a log's episodes: seed, run and repetition.
pub type Place = (i32, i32, i32);

pub fn place(head: &Episode) -> Place {
    (head.seed, head.run, head.repetition.unwrap_or(1))
}

pub(super) fn writer<W: Write + Seek>(out: W) -> mcap::McapResult<Writer<W>> {
    WriteOptions::new()
        .profile("")
        .library(concat!("mirrorstats ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Zstd))
        .compression_threads(0)
        // Chunks end with an episode, never at a number of bytes.
        .chunk_size(None)
        .create(out)
}

/// Merges the log `before`, if any, with these logs of one episode each. The result replaces `out` in one step; it is
/// written in `scratch`, a folder of the same disk. For an episode in both, `before` counts. The caller must check that
/// `before` belongs to `recording`.
pub fn assemble(
    out: &Path,
    before: Option<&Path>,
    parts: &[(Place, PathBuf)],
    recording: &Value,
    scratch: &Path,
) -> Result<(), LogError> {
    let before = before.map(LogPart::open).transpose()?;
    replaced(scratch, out, recording, |log| {
        let mut parts = parts.to_vec();
        parts.sort();
        let mut parts = parts.into_iter().peekable();
        let copy = |part: &Path, log: &mut _| LogPart::open(part)?.copy_episode(log, out);
        if let Some(mut before) = before {
            while let Some(place) = before.place() {
                while let Some((_, part)) = parts.next_if(|(of, _)| *of < place) {
                    copy(&part, log)?;
                }
                while parts.next_if(|(of, _)| *of == place).is_some() {}
                before.copy_episode(log, out)?;
            }
        }
        parts.try_for_each(|(_, part)| copy(&part, log))
    })
}

/// Rewrites the log at `path` without the episodes of these ids.
#[cfg(feature = "view")]
pub fn without(path: &Path, ids: &BTreeSet<String>, recording: &Value) -> Result<(), LogError> {
    let mut source = LogPart::open(path)?;
    replaced(folder_of(path), path, recording, |log| {
        while let Some((head, _)) = &source.begin {
            if ids.contains(&head.episode_id) { source.advance()? } else { source.copy_episode(log, path)? }
        }
        Ok(())
    })
}

fn replaced(
    scratch: &Path,
    out: &Path,
    recording: &Value,
    add: impl FnOnce(&mut Writer<BufWriter<NewFile>>) -> Result<(), LogError>,
) -> Result<(), LogError> {
    let file = NewFile::create_in(scratch, out).map_err(LogError::io("write", out))?;
    let mut log = writer(BufWriter::new(file)).map_err(LogError::writing(out))?;
    let metadata = BTreeMap::from([(METADATA_KEY.to_owned(), recording.to_string())]);
    let metadata = Metadata { name: METADATA.to_owned(), metadata };
    log.write_metadata(&metadata).map_err(LogError::writing(out))?;
    add(&mut log)?;
    log.finish().map_err(LogError::writing(out))?;
    let file = log.into_inner().into_inner().map_err(|error| LogError::io("write", out)(error.into_error()))?;
    file.commit().map_err(LogError::io("write", out))
}

struct LogPart {
    path: PathBuf,
    messages: Messages,
    begin: Option<(Episode, Message<'static>)>,
}

impl LogPart {
    fn open(path: &Path) -> Result<Self, LogError> {
        let messages = Messages::open(path)?;
        let mut source = Self { path: path.to_owned(), messages, begin: None };
        source.advance()?;
        Ok(source)
    }

    fn place(&self) -> Option<Place> {
        self.begin.as_ref().map(|(head, _)| place(head))
    }

    /// Moves to the begin of the next episode.
    fn advance(&mut self) -> Result<(), LogError> {
        self.begin = None;
        while let Some(message) = self.messages.next().transpose()? {
            if let Some(EpisodeMessage::Begin(head)) = self.episode_message(&message)? {
                self.begin = Some((*head, message));
                return Ok(());
            }
        }
        Ok(())
    }

    /// Copies the next episode, from its `begin` to its `end`, and ends the chunk after it.
    fn copy_episode<W: Write + Seek>(&mut self, log: &mut Writer<W>, out: &Path) -> Result<(), LogError> {
        let Some((head, begin)) = self.begin.take() else { return Ok(()) };
        log.write(&begin).map_err(LogError::writing(out))?;
        let mut has_ended = false;
        while let Some(message) = self.messages.next().transpose()? {
            log.write(&message).map_err(LogError::writing(out))?;
            if let Some(EpisodeMessage::End { .. }) = self.episode_message(&message)? {
                has_ended = true;
                break;
            }
        }
        if !has_ended {
            let fault = format!("the episode `{}` has no end", head.episode_id);
            return Err(LogError::Damaged { file: self.path.display().to_string(), fault });
        }
        log.flush().map_err(LogError::writing(out))?;
        self.advance()
    }

    fn episode_message(&self, message: &Message<'_>) -> Result<Option<EpisodeMessage>, LogError> {
        if message.channel.topic != topic::EPISODE {
            return Ok(None);
        }
        let found = serde_json::from_slice(&message.data);
        found.map(Some).map_err(|fault| self.messages.damaged(&format!("a message of {}: {fault}", topic::EPISODE)))
    }
}
