//! Reads the raw records of a log, past damage.
//!
//! Rule: an impossible length does not end reading: it continues at the next chunk or at the end of the data. Checksums
//! are computed along the way, so that damage is noticed even if it still reads as records.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::MAGIC;
use mcap::records::{Footer, Record, op};

use super::chunk::{Budgets, FRAME, LONGEST, inside, parsed};
use super::error::LogError;
use mirrorstats_exact::input;

/// The header of a chunk without the name of its compression.
const CHUNK_HEADER: usize = 8 + 8 + 8 + 4 + 4 + 8;

/// The footer: two positions and a checksum.
const FOOTER: usize = FRAME + 20;

#[derive(Debug)]
pub(super) enum RecordPiece {
    Record(Record<'static>),
    /// A chunk: its position, and its opcode, length and bytes.
    Chunk(u64, Vec<u8>),
    /// Bytes that are not a record; the next piece follows them.
    Damage(String),
    /// The end of the readable data: the reason, and the bytes of a truncated chunk, if it is one.
    Cut(String, Vec<u8>),
}

pub(super) struct Records<R> {
    bytes: R,
    at: u64,
    pub(super) end: u64,
    /// The damage in the record before, to be reported next.
    damage: Option<String>,
    running: crc32fast::Hasher,
    /// The checksum of the section that has ended.
    pub(super) checksum: u32,
    pub(super) budgets: Budgets,
}

/// An opcode, and the length of the contents.
#[derive(Clone, Copy)]
struct RecordHead {
    opcode: u8,
    length: u64,
}

impl RecordHead {
    fn parse(bytes: [u8; FRAME]) -> Self {
        let [opcode, length @ ..] = bytes;
        Self { opcode, length: u64::from_le_bytes(length) }
    }

    fn is_plausible(self, behind: u64) -> bool {
        (op::HEADER..=op::DATA_END).contains(&self.opcode)
            && self.length <= behind
            && usize::try_from(self.length).is_ok_and(|length| length <= LONGEST)
    }
}

impl Records<BufReader<File>> {
    pub(super) fn open(path: &Path) -> Result<Self, LogError> {
        let file = input::open(path).map_err(LogError::io("open", path))?;
        Self::from_reader(path, BufReader::new(file))
    }
}

impl<R: Read + Seek> Records<R> {
    /// The records of a log in these bytes; `path` is for error messages.
    pub(super) fn from_reader(path: &Path, bytes: R) -> Result<Self, LogError> {
        Self::new(bytes).map_err(LogError::io("read", path))?.ok_or_else(|| LogError::Foreign {
            file: path.display().to_string(),
            fault: "it does not begin as an MCAP file does".to_owned(),
        })
    }

    /// The records after the first magic bytes; `None` if the file does not start with them.
    fn new(mut bytes: R) -> io::Result<Option<Self>> {
        let end = bytes.seek(SeekFrom::End(0))?;
        let mut records = Self {
            bytes,
            at: 0,
            end,
            damage: None,
            running: crc32fast::Hasher::new(),
            checksum: 0,
            budgets: Budgets::new(end),
        };
        let begin = records.read(0, MAGIC.len())?;
        records.running.update(&begin);
        records.at = begin.len() as u64;
        Ok((begin == MAGIC).then_some(records))
    }

    pub(super) fn next(&mut self) -> io::Result<Option<RecordPiece>> {
        if let Some(damage) = self.damage.take() {
            return Ok(Some(RecordPiece::Damage(damage)));
        }
        if self.at >= self.end {
            return Ok(None);
        }
        let Some(frame) = self.frame(self.at)? else {
            return self.past_damage("no record begins there").map(Some);
        };
        let whole = self.whole(self.at, frame)?;
        let behind = self.at + whole.len() as u64;
        // Its length is right if another record follows it.
        let is_followed = frame.opcode == op::FOOTER || behind == self.end || self.frame(behind)?.is_some();
        let from = self.at;
        match decode(from, frame.opcode, &whole) {
            Ok(piece) => {
                self.sum(frame.opcode, &whole);
                let next = if is_followed { None } else { self.landmark(from + 1)? };
                self.at = next.unwrap_or(behind);
                self.damage = next.map(|_| format!("the record at byte {from} is not as long as it says"));
                Ok(Some(piece))
            }
            Err(fault) if is_followed => {
                self.at = behind;
                Ok(Some(RecordPiece::Damage(format!("the record at byte {from} cannot be read: {fault}"))))
            }
            Err(fault) => self.past_damage(&fault).map(Some),
        }
    }

    pub(super) fn is_closed(&mut self) -> io::Result<bool> {
        Ok(self.read(self.at, MAGIC.len() + 1)? == MAGIC)
    }

    /// The records of the index; none if its checksum differs, since a reader trusts its positions.
    #[cfg(feature = "view")]
    pub(super) fn verified_summary(&mut self) -> io::Result<Vec<Record<'static>>> {
        let (last, footer) = self.footer()?;
        let counted = usize::try_from(last - footer.summary_start).unwrap_or(LONGEST) + FOOTER - 4;
        let is_sound = |bytes: &[u8]| footer.summary_crc == 0 || crc32fast::hash(bytes) == footer.summary_crc;
        if is_sound(&self.read(footer.summary_start, counted)?) { self.summary() } else { Ok(Vec::new()) }
    }

    /// The position of the footer, and the footer; without one, that of an empty index.
    fn footer(&mut self) -> io::Result<(u64, Footer)> {
        let last = self.end.saturating_sub((FOOTER + MAGIC.len()) as u64);
        let footer = self.read(last, FOOTER)?;
        Ok(match footer.first().map(|opcode| decode(last, *opcode, &footer)) {
            Some(Ok(RecordPiece::Record(Record::Footer(footer)))) if footer.summary_start < last => (last, footer),
            _ => (last, Footer { summary_start: last, ..Footer::default() }),
        })
    }

    pub(super) fn summary(&mut self) -> io::Result<Vec<Record<'static>>> {
        let (last, footer) = self.footer()?;
        let mut found = Vec::new();
        let mut at = footer.summary_start;
        while let Some(frame) = self.frame(at)?.filter(|_| at < last) {
            let whole = self.whole(at, frame)?;
            if let Ok(RecordPiece::Record(record)) = decode(at, frame.opcode, &whole) {
                found.push(record);
            }
            at += whole.len() as u64;
        }
        Ok(found)
    }

    /// The chunk at a position, with its frame; `None` if there is no chunk.
    #[cfg(feature = "view")]
    pub(super) fn chunk_at(&mut self, at: u64) -> io::Result<Option<Vec<u8>>> {
        match self.frame(at)?.filter(|frame| frame.opcode == op::CHUNK) {
            Some(frame) => self.whole(at, frame).map(Some),
            None => Ok(None),
        }
    }

    /// The data's checksum covers everything before its end record, the index's the bytes from there up to itself.
    fn sum(&mut self, opcode: u8, whole: &[u8]) {
        let (counted, is_last) = match opcode {
            op::DATA_END => (&[][..], true),
            op::FOOTER => (whole.get(..whole.len().saturating_sub(4)).unwrap_or_default(), true),
            _ => (whole, false),
        };
        self.running.update(counted);
        if is_last {
            self.checksum = std::mem::take(&mut self.running).finalize();
        }
    }

    fn read(&mut self, at: u64, count: usize) -> io::Result<Vec<u8>> {
        let count = (count as u64).min(self.end.saturating_sub(at));
        self.bytes.seek(SeekFrom::Start(at))?;
        let mut bytes = Vec::with_capacity(usize::try_from(count).unwrap_or_default());
        self.bytes.by_ref().take(count).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    fn frame(&mut self, at: u64) -> io::Result<Option<RecordHead>> {
        let bytes = self.read(at, FRAME)?;
        let behind = self.end.saturating_sub(at + FRAME as u64);
        let frame = <[u8; FRAME]>::try_from(bytes).ok().map(RecordHead::parse);
        Ok(frame.filter(|frame| frame.is_plausible(behind)))
    }

    fn whole(&mut self, at: u64, frame: RecordHead) -> io::Result<Vec<u8>> {
        self.read(at, FRAME + usize::try_from(frame.length).unwrap_or(LONGEST))
    }

    fn past_damage(&mut self, fault: &str) -> io::Result<RecordPiece> {
        let from = self.at;
        Ok(if let Some(next) = self.landmark(from + 1)? {
            self.at = next;
            RecordPiece::Damage(format!("bytes {from} to {next} cannot be read: {fault}"))
        } else {
            self.at = self.end;
            let tail = self.read(from, LONGEST)?;
            let tail = if tail.first() == Some(&op::CHUNK) { tail } else { Vec::new() };
            RecordPiece::Cut(format!("the log ends before its end record: after byte {from} nothing can be read"), tail)
        })
    }

    fn landmark(&mut self, from: u64) -> io::Result<Option<u64>> {
        const WINDOW: usize = 1 << 16;
        let mut start = from;
        loop {
            let window = self.read(start, WINDOW)?;
            for (at, bytes) in (start..).zip(window.windows(FRAME)) {
                let frame = <[u8; FRAME]>::try_from(bytes).map(RecordHead::parse);
                if let Ok(frame) = frame
                    && self.is_landmark(at, frame)?
                {
                    return Ok(Some(at));
                }
            }
            if window.len() < FRAME {
                return Ok(None);
            }
            start += (window.len() - FRAME + 1) as u64;
        }
    }

    fn is_landmark(&mut self, at: u64, frame: RecordHead) -> io::Result<bool> {
        let behind = self.end.saturating_sub(at + FRAME as u64);
        if !frame.is_plausible(behind) {
            return Ok(false);
        }
        Ok(match frame.opcode {
            op::CHUNK => {
                // Beyond the budget the search stops, and the log is cut there.
                if self.budgets.search(usize::try_from(frame.length).unwrap_or(LONGEST)).is_err() {
                    return Ok(false);
                }
                let whole = self.whole(at, frame)?;
                inside(&whole, &self.budgets).is_ok()
            }
            op::DATA_END => frame.length == 4,
            _ => false,
        })
    }
}

fn decode(at: u64, opcode: u8, whole: &[u8]) -> Result<RecordPiece, String> {
    let body = whole.get(FRAME..).unwrap_or_default();
    match opcode {
        op::CHUNK => match parsed(op::CHUNK, body) {
            Ok(Record::Chunk { header, data })
                if CHUNK_HEADER + header.compression.len() + data.len() == body.len() && !data.is_empty() =>
            {
                Ok(RecordPiece::Chunk(at, whole.to_vec()))
            }
            Ok(_) => Err("a chunk of another length than it says".to_owned()),
            Err(fault) => Err(fault),
        },
        // An end record counts only with its exact length, since no episodes are read after it.
        op::DATA_END if body.len() != 4 => Err("an end record of another length".to_owned()),
        // Our logs have no attachments, and the library expects valid ones.
        op::ATTACHMENT => Ok(RecordPiece::Record(Record::Unknown { opcode, data: Vec::new().into() })),
        _ => Ok(RecordPiece::Record(parsed(opcode, body)?.into_owned())),
    }
}
