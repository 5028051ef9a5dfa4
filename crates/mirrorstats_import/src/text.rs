//! An opened file of steps: its kind, its hash, and its rows once they are read.
//!
//! Input that cannot be read twice (standard input, a pipe) and compressed files go through a temporary file.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek as _};
use std::path::Path;
use std::sync::Arc;

use arrow::array::RecordBatch;
use arrow::error::ArrowError;
use serde_json::Value;

use super::beside::Beside;
use super::error::{Fault, Faults, ImportError, Location};
use super::format::lerobot;
use super::format::objects::rows_of_table;
use super::format::{Format, HEAD};
use super::json::BYTE_ORDER_MARK;
use super::mapping::{Given, Mapping, Order};
use super::notes::Notes;
use super::rows::Rows;
use super::spool::Spool;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::{hash, input};
use mirrorstats_trace::inputs::{Input, NULL_FOLDER, folder_values, is_data_set};

#[derive(Debug)]
pub struct Text {
    pub(super) name: Arc<str>,
    /// The path as it was typed, for patterns of mappings.
    path: String,
    file: File,
    /// The columns in the names of folders.
    pub(super) folders: Vec<(String, Option<String>)>,
    /// The hash of the file as it was compressed.
    sha256: Option<String>,
    pub(super) read: Option<Steps>,
}

/// The steps of a text, which a mapping made of its rows.
#[derive(Debug)]
pub(super) struct Steps {
    /// The hash of the source.
    sha256: String,
    /// The hash of the files of steps beside the source.
    beside: Option<String>,
    pub(super) noun: &'static str,
    pub(super) format: Format,
    /// The mapping for the footer; `None` for unmapped lines of steps.
    pub(super) mapping: Option<Value>,
    pub(super) order: Order,
    /// Required columns that the mapping declares absent.
    pub(super) absent: Vec<String>,
    pub(super) spool: Spool,
    pub(super) faults: Faults,
}

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
        Ok(Self { path: path.display().to_string(), folders: folder_values(path), ..text })
    }

    /// The rest of a stream, stored in a temporary file.
    pub fn spool(name: &str, stream: impl Read) -> Result<Self, ImportError> {
        Self::of_file(name, copied(name, stream, LARGEST_STREAM)?).inflated()
    }

    /// The text in a file that gzip or zstd compressed.
    fn inflated(mut self) -> Result<Self, ImportError> {
        let name = Arc::clone(&self.name);
        let failed = || ImportError::read(&name);
        let limit = most_inflated(self.file.metadata().map_err(failed())?.len());
        let head = self.head()?;
        let inflate: Box<dyn Read + '_> = match head.first_chunk::<4>() {
            Some([0x1f, 0x8b, ..]) => Box::new(flate2::read::MultiGzDecoder::new(&self.file)),
            Some([0x28, 0xb5, 0x2f, 0xfd]) => Box::new(zstd::Decoder::new(&self.file).map_err(failed())?),
            _ => return Ok(self),
        };
        let file = copied(&name, inflate, limit)?;
        let sha256 = Some(self.hash()?);
        Ok(Self { sha256, ..Self::of_file(&name, file) })
    }

    fn of_file(name: &str, file: File) -> Self {
        Self { name: name.into(), path: String::new(), file, folders: Vec::new(), sha256: None, read: None }
    }

    /// The first bytes. The file is then at its start.
    fn head(&mut self) -> Result<Vec<u8>, ImportError> {
        let mut head = Vec::new();
        let read = self.file.rewind().and_then(|()| (&self.file).take(HEAD).read_to_end(&mut head));
        read.and_then(|_| self.file.rewind()).map_err(ImportError::read(&self.name))?;
        Ok(head)
    }

    fn hash(&mut self) -> Result<String, ImportError> {
        if let Some(known) = &self.sha256 {
            return Ok(known.clone());
        }
        let hash = self.file.rewind().and_then(|()| hash::of_reader(&mut self.file));
        hash.map_err(ImportError::read(&self.name))
    }

    /// Reads the rows of the file in this format, or else in that of its first bytes or its name.
    pub fn read(&mut self, mapping: &Mapping, format: Option<Format>, notes: &mut Notes) -> Result<(), ImportError> {
        let head = self.head()?;
        let detect = || Format::detect(&self.name, &head, !mapping.lists.is_empty());
        let plain = Mapping::default();
        let mapping = if mapping.is_for_another(format.unwrap_or_else(detect)) { &plain } else { mapping };
        let format = format.or(mapping.format).unwrap_or_else(detect);
        let effective = format.mapping(&head).map(|built_in| mapping.over(built_in));
        let effective = effective.as_ref().unwrap_or(mapping);
        let sha256 = self.hash()?;
        let file = self.file.try_clone().map_err(ImportError::read(&self.name))?;
        let bytes = file.metadata().map_err(ImportError::read(&self.name))?.len();
        let given = effective.parts_of_path(&self.path);
        let folder = Path::new(&self.path).parent().map(Path::to_owned);
        let read = |rows: &mut Rows<'_>| {
            rows.beside = Beside::new(folder);
            format.read(file, rows)
        };
        self.read = Some(Steps::of((&self.name, bytes, sha256), (format, effective, mapping), given, notes, read)?);
        Ok(())
    }

    /// The format if it has a mapping of its own; else, if the file is JSON, its first values.
    pub(super) fn sample(&mut self, most: usize) -> Result<(Option<Format>, Option<Vec<Value>>), ImportError> {
        let head = self.head()?;
        let format = Format::detect(&self.name, &head, false);
        if format == Format::Inspect || format.mapping(&head).is_some() {
            return Ok((Some(format), None));
        }
        if format != Format::JsonLines {
            return Ok((None, None));
        }
        let start = head.strip_prefix(BYTE_ORDER_MARK).map_or(0, |_| BYTE_ORDER_MARK.len() as u64);
        self.file.seek(io::SeekFrom::Start(start)).map_err(ImportError::read(&self.name))?;
        let values = serde_json::Deserializer::from_reader(BufReader::new(&self.file)).into_iter::<Value>();
        let values = values.take(most).collect::<Result<Vec<_>, _>>().map_err(|error| Fault {
            expected: "strict JSON: an object per line, a list of objects, or one object".into(),
            found: error.to_string(),
            help: "correct the file; NaN and infinities are no JSON".into(),
            ..Fault::of_file(&self.name)
        })?;
        let items = |value| if let Value::Array(items) = value { items } else { vec![value] };
        let rows = |value| rows_of_table(&value).unwrap_or_else(|| vec![value]);
        let values = values.into_iter().flat_map(items).filter(Value::is_object).flat_map(rows);
        Ok((None, Some(values.collect())))
    }

    pub(super) fn batches(&self) -> usize {
        self.read.as_ref().map_or(0, |read| read.spool.batches.len())
    }

    /// The frames of a data set of `LeRobot`; `None` if the folder is none.
    pub fn of_data_set(folder: &Path, mapping: &Mapping, notes: &mut Notes) -> Result<Option<Self>, ImportError> {
        if !is_data_set(folder) {
            return Ok(None);
        }
        let (name, format) = (Input::new(folder).name, Format::LeRobot);
        let source = (name.as_str(), lerobot::bytes_of(folder)?, lerobot::hash_of(folder)?);
        let effective = mapping.over(format.mapping(b"PAR1").unwrap_or_default());
        let read = |rows: &mut Rows<'_>| lerobot::read_folder(folder, rows);
        let read = Steps::of(source, (format, &effective, mapping), Given::new(), notes, read)?;
        let file = tempfile::tempfile().map_err(ImportError::read(&name))?;
        Ok(Some(Self { read: Some(read), ..Self::of_file(&name, file) }))
    }

    /// The built-in definitions of its format, if it has a domain and is read.
    pub fn definitions(&self) -> Option<&'static str> {
        self.read.as_ref()?.format.definitions()
    }

    /// The steps; those of plain lines if nothing else was asked for.
    pub(super) fn steps(&mut self) -> Result<&mut Steps, ImportError> {
        if self.read.is_none() {
            self.read(&Mapping::default(), Some(Format::JsonLines), &mut Notes::default())?;
        }
        Ok(self.read.as_mut().expect("it was just read"))
    }

    /// The same fault, if the name of a folder says null, with that in its help.
    pub(super) fn of_folder(&self, fault: Fault) -> Fault {
        let is_null = |(name, value): &(String, Option<String>)| Some(name) == fault.key.as_ref() && value.is_none();
        if !self.folders.iter().any(is_null) {
            return fault;
        }
        let help = format!(
            "the folder `{}={NULL_FOLDER}` says null: rename it, or leave its files out",
            fault.key.as_deref().unwrap_or_default()
        );
        Fault { help, ..fault }
    }

    pub(super) fn batch(&self, batch: usize) -> Result<RecordBatch, ImportError> {
        let none = || ArrowError::InvalidArgumentError("no rows were read".into());
        self.read.as_ref().ok_or_else(none).and_then(|read| read.spool.read(batch)).map_err(self.failed())
    }

    pub(super) fn failed(&self) -> impl FnOnce(ArrowError) -> ImportError + use<> {
        let failed = ImportError::read(&self.name);
        move |error| failed(io::Error::other(error.to_string()))
    }

    /// The place of a row of a batch.
    pub(super) fn place(&self, batch: usize, row: usize) -> Location {
        let read = self.read.as_ref();
        let stored = read.map(|read| &read.spool.batches[batch]);
        let line = stored.map_or(0, |batch| batch.lines.at(row));
        let (file, noun) = match stored.and_then(|batch| batch.beside.as_ref()) {
            Some(beside) => (beside, "line"),
            None => (&self.name, read.map_or("row", |read| read.noun)),
        };
        Location { file: Arc::clone(file), noun, line }
    }
}

impl Steps {
    /// The steps that `read` adds, by the mapping that was asked for, which may be on top of the format's own.
    fn of(
        (name, bytes, sha256): (&str, u64, String),
        (format, effective, asked): (Format, &Mapping, &Mapping),
        mut given: Given,
        notes: &mut Notes,
        read: impl FnOnce(&mut Rows<'_>) -> Result<(), ImportError>,
    ) -> Result<Self, ImportError> {
        given.insert("file#".to_owned(), sha256.chars().take(8).collect());
        let mut rows = Rows::new(name, given, bytes, effective, notes)?;
        read(&mut rows)?;
        let is_plain = rows.is_strict && asked.is_empty();
        let (noun, order, mapping) = (rows.noun, effective.order(), (!is_plain).then(|| asked.declared()));
        let (spool, faults, beside) = rows.finish()?;
        let absent = effective.settings.absent.clone();
        Ok(Self { sha256, beside, noun, format, mapping, order, absent, spool, faults })
    }

    pub(super) fn hashes(&self) -> impl Iterator<Item = &str> {
        [self.sha256.as_str()].into_iter().chain(self.beside.as_deref())
    }
}

fn copied(name: &str, stream: impl Read, limit: Limit) -> Result<File, ImportError> {
    let mut file = tempfile::tempfile().map_err(ImportError::read(name))?;
    let copied = io::copy(&mut stream.take(limit.most().saturating_add(1)), &mut file);
    let checked = copied.and_then(|bytes| limit.check(bytes).map_err(Into::into)).and_then(|()| file.rewind());
    checked.map_err(ImportError::read(name))?;
    Ok(file)
}
