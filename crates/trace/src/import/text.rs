//! A text of lines that is read twice: from start to end, then line by line at known positions.
//!
//! Input that cannot be read twice (standard input, a pipe) goes through a temporary file. A byte order mark and blank
//! lines are skipped, but blank lines are counted. A line may end with `\n` or `\r\n`.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::error::{ImportError, Place};
use super::format::lerobot::data_set;
use super::format::{Format, RowSink};
use super::line::BYTE_ORDER_MARK;
use super::mapping::Mapping;
use crate::inputs::Input;
use exact::budget::Limit;
use exact::{hash, input};

#[derive(Debug)]
pub struct Text {
    pub(super) name: Arc<str>,
    noun: &'static str,
    reader: BufReader<File>,
    /// The position of the reader, in bytes from the start.
    offset: u64,
    lines: u64,
    pub(super) source: Option<Source>,
}

/// A file of another shape, and the mapping of its rows to steps.
#[derive(Clone, Debug)]
pub(super) struct Source {
    sha256: String,
    pub(super) format: Format,
    pub(super) mapping: Value,
}

#[derive(Debug)]
pub(super) struct Line {
    pub(super) place: Place,
    pub(super) offset: u64,
    pub(super) bytes: Vec<u8>,
    /// True if it ends with a line feed; the last line of a truncated file does not.
    pub(super) ended: bool,
}

/// A step with its whole reply; the longest reply of a model has some hundred thousand bytes.
pub(super) const LONGEST_LINE: Limit = Limit::new("bytes in a line of steps", 16 << 20);

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
        if about.is_file() { Ok(Self::of_file(&name, file)) } else { Self::spool(&name, file) }
    }

    /// The rows of a folder as lines of flat steps, in a temporary file; `None` if it is not a data set of `LeRobot`.
    pub fn of_data_set(folder: &Path, mapping: &mut Mapping) -> Result<Option<Self>, ImportError> {
        if !data_set::is_data_set(folder) {
            return Ok(None);
        }
        let (name, format) = (Input::new(folder).name, Format::LeRobot);
        let source = Source { sha256: data_set::hash_of(folder)?, format, mapping: mapping.declared() };
        let mut rows = RowSink::new(&name, &source.sha256, mapping)?;
        data_set::read_folder(folder, &mut rows)?;
        let lines = Self::of_file(&name, rows.finish()?);
        Ok(Some(Self { noun: format.noun(), source: Some(source), ..lines }))
    }

    /// The rest of a stream, stored in a temporary file.
    pub fn spool(name: &str, stream: impl Read) -> Result<Self, ImportError> {
        let mut file = tempfile::tempfile().map_err(ImportError::read(name))?;
        let copied = io::copy(&mut stream.take(LARGEST_STREAM.most().saturating_add(1)), &mut file);
        let checked = copied.and_then(|bytes| LARGEST_STREAM.check(bytes).map_err(Into::into));
        checked.map_err(ImportError::read(name))?;
        Ok(Self::of_file(name, file))
    }

    /// The rows of a file of this format as lines of flat steps, in a temporary file.
    pub fn mapped(mut self, format: Format, mapping: &mut Mapping) -> Result<Self, ImportError> {
        if format == Format::JsonLines && mapping.is_empty() {
            return Ok(self);
        }
        let source = Source { sha256: self.hash()?, format, mapping: mapping.declared() };
        let mut rows = RowSink::new(&self.name, &source.sha256, mapping)?;
        match format {
            Format::JsonLines => while rows.add_line(&self.read_line()?)? {},
            _ => format.read(self.reader.into_inner(), &mut rows)?,
        }
        let lines = Self::of_file(&self.name, rows.finish()?);
        Ok(Self { noun: format.noun(), source: Some(source), ..lines })
    }

    fn of_file(name: &str, file: File) -> Self {
        let reader = BufReader::new(file);
        Self { name: name.into(), noun: "line", reader, offset: 0, lines: 0, source: None }
    }

    pub(super) fn place(&self, line: u64) -> Place {
        Place { file: Arc::clone(&self.name), noun: self.noun, line }
    }

    pub(super) fn rewind(&mut self) -> Result<(), ImportError> {
        self.reader.rewind().map_err(ImportError::read(&self.name))?;
        (self.offset, self.lines) = (0, 0);
        Ok(())
    }

    pub(super) fn hash(&mut self) -> Result<String, ImportError> {
        if let Some(source) = &self.source {
            return Ok(source.sha256.clone());
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
            skip_mark(offset, &mut bytes);
            if !bytes.trim_ascii().is_empty() {
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
        skip_mark(offset, &mut bytes);
        Ok(bytes)
    }

    fn read_line(&mut self) -> Result<Vec<u8>, ImportError> {
        let bytes = input::line(&mut self.reader, LONGEST_LINE).map_err(ImportError::read(&self.name))?;
        self.offset += bytes.len() as u64;
        Ok(bytes)
    }
}

fn skip_mark(offset: u64, line: &mut Vec<u8>) {
    if offset == 0 && line.starts_with(BYTE_ORDER_MARK) {
        line.drain(..BYTE_ORDER_MARK.len());
    }
}
