//! A text of lines, or rows stored by their types, that is read twice: from start to end, then at known positions.
//!
//! Input that cannot be read twice (standard input, a pipe) goes through a temporary file. A byte order mark and blank
//! lines are skipped, but blank lines are counted. A line may end with `\n` or `\r\n`.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::error::{Fault, ImportError, Location};
use super::format::lerobot::data_set;
use super::format::{Format, HEAD, RowSink};
use super::line::{self, BYTE_ORDER_MARK, LONGEST_LINE, Line};
use super::mapping::Mapping;
use super::value::{LineValue, Members};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::{hash, input};
use mirrorstats_trace::inputs::{Input, NULL_FOLDER, folder_values};

#[derive(Debug)]
pub struct Text {
    pub(super) name: Arc<str>,
    noun: &'static str,
    reader: BufReader<File>,
    offset: u64,
    lines: u64,
    pub(super) folders: Members,
    /// The hash of the file as it was compressed.
    sha256: Option<String>,
    pub(super) source: Option<Source>,
}

/// A file of another shape, and the mapping of its rows to steps.
#[derive(Clone, Debug)]
pub(super) struct Source {
    sha256: String,
    pub(super) format: Format,
    pub(super) mapping: Value,
}

const LENGTH: usize = size_of::<u32>();

const fn most_inflated(bytes: u64) -> Limit {
    Limit::in_proportion("bytes inflated from a file of its size", 64 << 20, 96, bytes)
}

/// The limit for piped input, which is stored on disk meanwhile.
const LARGEST_STREAM: Limit = Limit::new("bytes of steps that are piped in", 64 << 30);

impl Text {
    pub fn open(path: &Path) -> Result<Self, ImportError> {
        let name = Input::new(path).name;
        let failed = || ImportError::read(&name);
        if path.is_dir() {
            return Err(failed()(io::Error::new(
                io::ErrorKind::IsADirectory,
                "it is a folder; name the files in it, or the folder of `meta/info.json` of a LeRobot data set",
            )));
        }
        let file = input::open_text(path).map_err(failed())?;
        let about = file.metadata().map_err(failed())?;
        let text = if about.is_file() { Self::of_file(&name, file).inflated()? } else { Self::spool(&name, file)? };
        let cell = |value: Option<String>| value.map_or(LineValue::Null, LineValue::Cell);
        let folders = folder_values(path).into_iter().map(|(name, value)| (name, cell(value))).collect();
        Ok(Self { folders, ..text })
    }

    /// The text in a file that gzip or zstd compressed.
    fn inflated(mut self) -> Result<Self, ImportError> {
        let failed = || ImportError::read(&self.name);
        let bytes = self.reader.get_ref().metadata().map_err(failed())?.len();
        let mut start = [0; 4];
        let read = self.reader.read(&mut start).map_err(failed())?;
        self.reader.rewind().map_err(failed())?;
        let stored = &mut self.reader;
        let inflate: Box<dyn Read + '_> = match &start[..read] {
            [0x1f, 0x8b, ..] => Box::new(flate2::read::MultiGzDecoder::new(stored)),
            [0x28, 0xb5, 0x2f, 0xfd] => Box::new(zstd::stream::read::Decoder::with_buffer(stored).map_err(failed())?),
            _ => return Ok(self),
        };
        let limit = most_inflated(bytes);
        let mut file = tempfile::tempfile().map_err(failed())?;
        let copied = io::copy(&mut inflate.take(limit.most().saturating_add(1)), &mut file);
        copied.and_then(|bytes| limit.check(bytes).map_err(Into::into)).map_err(failed())?;
        file.rewind().map_err(failed())?;
        let sha256 = Some(self.hash()?);
        Ok(Self { sha256, ..Self::of_file(&self.name, file) })
    }

    /// The format by the first bytes and the name.
    pub fn format(&mut self) -> Result<Format, ImportError> {
        self.rewind()?;
        let mut head = Vec::new();
        self.reader.by_ref().take(HEAD).read_to_end(&mut head).map_err(ImportError::read(&self.name))?;
        self.rewind()?;
        Ok(Format::detect(&self.name, &head))
    }

    /// The rows of a folder as lines of flat steps, in a temporary file; `None` if it is not a data set of `LeRobot`.
    pub fn of_data_set(folder: &Path, mapping: &mut Mapping) -> Result<Option<Self>, ImportError> {
        if !data_set::is_data_set(folder) {
            return Ok(None);
        }
        let (name, format) = (Input::new(folder).name, Format::LeRobot);
        let source = Source { sha256: data_set::hash_of(folder)?, format, mapping: mapping.declared() };
        let mut rows = RowSink::new(&name, data_set::bytes_of(folder)?, &source.sha256, mapping)?;
        data_set::read_folder(folder, &mut rows)?;
        let rows = Self::of_file(&name, rows.finish()?);
        Ok(Some(Self { noun: "row", source: Some(source), ..rows }))
    }

    /// The rest of a stream, stored in a temporary file.
    pub fn spool(name: &str, stream: impl Read) -> Result<Self, ImportError> {
        let mut file = tempfile::tempfile().map_err(ImportError::read(name))?;
        let copied = io::copy(&mut stream.take(LARGEST_STREAM.most().saturating_add(1)), &mut file);
        let checked = copied.and_then(|bytes| LARGEST_STREAM.check(bytes).map_err(Into::into));
        checked.map_err(ImportError::read(name))?;
        Self::of_file(name, file).inflated()
    }

    /// The rows of a file of this format, stored by their types in a temporary file.
    pub fn mapped(mut self, format: Format, mapping: &mut Mapping) -> Result<Self, ImportError> {
        let is_list = self.format()? == Format::JsonLines && self.begins_a_list()?;
        let are_lines = format == Format::JsonLines && !is_list;
        if are_lines && mapping.is_empty() {
            return Ok(self);
        }
        let bytes = self.reader.get_ref().metadata().map_err(ImportError::read(&self.name))?.len();
        let source = Source { sha256: self.hash()?, format, mapping: mapping.declared() };
        let mut rows = RowSink::new(&self.name, bytes, &source.sha256, mapping)?;
        if are_lines {
            while let Some(line) = self.next_line()? {
                rows.add_line(&line)?;
            }
        } else {
            format.read(self.reader.into_inner(), &mut rows)?;
        }
        let rows = Self::of_file(&self.name, rows.finish()?);
        let noun = if are_lines { "line" } else { "row" };
        Ok(Self { noun, folders: self.folders, source: Some(source), ..rows })
    }

    /// The same fault, if the name of a folder says null, with that in its help.
    pub(super) fn of_folder(&self, fault: Fault) -> Fault {
        let is_null =
            |(name, value): &(String, LineValue)| Some(name) == fault.key.as_ref() && *value == LineValue::Null;
        if !self.folders.iter().any(is_null) {
            return fault;
        }
        let help = format!(
            "the folder `{}={NULL_FOLDER}` says null: rename it, or leave its files out",
            fault.key.as_deref().unwrap_or_default()
        );
        Fault { help, ..fault }
    }

    fn begins_a_list(&mut self) -> Result<bool, ImportError> {
        let head = self.reader.fill_buf().map_err(ImportError::read(&self.name))?;
        let head = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head);
        Ok(head.trim_ascii_start().starts_with(b"["))
    }

    fn of_file(name: &str, file: File) -> Self {
        let reader = BufReader::new(file);
        Self {
            name: name.into(),
            noun: "line",
            reader,
            offset: 0,
            lines: 0,
            folders: Vec::new(),
            sha256: None,
            source: None,
        }
    }

    pub(super) fn place(&self, line: u64) -> Location {
        Location { file: Arc::clone(&self.name), noun: self.noun, line }
    }

    pub(super) fn rewind(&mut self) -> Result<(), ImportError> {
        self.reader.rewind().map_err(ImportError::read(&self.name))?;
        (self.offset, self.lines) = (0, 0);
        Ok(())
    }

    pub(super) fn hash(&mut self) -> Result<String, ImportError> {
        if let Some(known) = self.source.as_ref().map(|source| &source.sha256).or(self.sha256.as_ref()) {
            return Ok(known.clone());
        }
        self.rewind()?;
        let hash = hash::of_reader(&mut self.reader).map_err(ImportError::read(&self.name))?;
        self.rewind()?;
        Ok(hash)
    }

    /// The next line that is not blank; `None` at the end of the text.
    pub(super) fn next_line(&mut self) -> Result<Option<Line>, ImportError> {
        loop {
            let offset = self.offset;
            let mut bytes = self.read_line()?;
            if bytes.is_empty() {
                return Ok(None);
            }
            self.lines += 1;
            let ended = bytes.ends_with(b"\n");
            self.strip(offset, &mut bytes);
            if !bytes.trim_ascii().is_empty() || self.source.is_some() && !bytes.is_empty() {
                let place = self.place(self.lines);
                return Ok(Some(Line { place, offset, bytes, ended }));
            }
        }
    }

    pub(super) fn line_at(&mut self, offset: u64) -> Result<Vec<u8>, ImportError> {
        let failed = || ImportError::read(&self.name);
        if offset != self.offset {
            // Seeking within the buffer costs nothing.
            match i64::try_from(i128::from(offset) - i128::from(self.offset)) {
                Ok(distance) => self.reader.seek_relative(distance).map_err(failed())?,
                Err(_) => drop(self.reader.seek(SeekFrom::Start(offset)).map_err(failed())?),
            }
            self.offset = offset;
        }
        let mut bytes = self.read_line()?;
        self.strip(offset, &mut bytes);
        Ok(bytes)
    }

    pub(super) fn members(&self, bytes: &[u8], ended: bool) -> Result<Members, Box<Fault>> {
        if self.source.is_some() { line::of_record(bytes) } else { line::members(bytes, ended) }
    }

    /// Removes what stands before the contents: the length of a stored row, or a byte order mark.
    fn strip(&self, offset: u64, bytes: &mut Vec<u8>) {
        if self.source.is_some() {
            bytes.drain(..LENGTH);
        } else if offset == 0 && bytes.starts_with(BYTE_ORDER_MARK) {
            bytes.drain(..BYTE_ORDER_MARK.len());
        }
    }

    /// The bytes of a line, or of a stored row behind its length; empty at the end.
    fn read_line(&mut self) -> Result<Vec<u8>, ImportError> {
        let bytes = match self.source {
            Some(_) => record(&mut self.reader),
            None => input::line(&mut self.reader, LONGEST_LINE),
        };
        let bytes = bytes.map_err(ImportError::read(&self.name))?;
        self.offset += bytes.len() as u64;
        Ok(bytes)
    }
}

fn record(rows: &mut impl BufRead) -> io::Result<Vec<u8>> {
    if rows.fill_buf()?.is_empty() {
        return Ok(Vec::new());
    }
    let mut length = [0; LENGTH];
    rows.read_exact(&mut length)?;
    let mut bytes = vec![0; LENGTH + u32::from_le_bytes(length) as usize];
    rows.read_exact(&mut bytes[LENGTH..])?;
    Ok(bytes)
}
