//! Reads the messages of a log that must be complete, one by one, in constant memory.
//!
//! Rule: the first damage ends reading with an error that gives its place. Every length is compared with the rest of
//! the file before memory of that size is allocated.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};

use mcap::Message;
use mcap::read::ChannelAccumulator;
use mcap::records::Record;

use super::chunk::{Unpacked, inside};
use super::error::LogError;
use super::records::{Piece, Records};

use exact::input;

/// The messages of a log up to its end record.
pub(super) struct Messages<R> {
    path: PathBuf,
    records: Records<R>,
    channels: ChannelAccumulator<'static>,
    chunk: Unpacked,
    at: u64,
    has_ended: bool,
}

impl Messages<BufReader<File>> {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let file = input::open(path).map_err(LogError::io("open", path))?;
        let records = Records::new(BufReader::new(file)).map_err(LogError::io("read", path))?;
        let records = records.ok_or_else(|| LogError::no_log(path))?;
        let channels = ChannelAccumulator::default();
        Ok(Self { path: path.to_owned(), records, channels, chunk: Unpacked::default(), at: 0, has_ended: false })
    }
}

impl<R: Read + Seek> Messages<R> {
    /// The error for a message with invalid contents in the last chunk.
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
                Some(Piece::Record(Record::DataEnd(end))) => {
                    let (written, found) = (end.data_section_crc, self.records.checksum());
                    if written == 0 || written == found {
                        return Ok(None);
                    }
                    format!("the checksum of the data: expected {written:08x}, found {found:08x}")
                }
                Some(Piece::Record(record)) => return Ok(Some(record)),
                Some(Piece::Chunk(at, bytes)) => match inside(&bytes, self.records.budgets()) {
                    Ok(records) => {
                        (self.chunk, self.at) = (records, at);
                        continue;
                    }
                    Err(fault) => format!("the chunk at byte {at}: {fault}"),
                },
                Some(Piece::Damage(fault) | Piece::Cut(fault, _)) => fault,
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

impl<R: Read + Seek> Iterator for Messages<R> {
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
