//! Reads files of other harnesses as rows. Each format has one file; all rows become lines of steps by one mapping.
//!
//! Rule: keys that a format does not give are absent or null. Records that are not steps are counted and named.

mod csv;
mod inspect;
mod inspect_robots;
mod json;
mod json_log;
pub(super) mod lerobot;
mod parquet;

use std::fs::File;
use std::io::{BufWriter, Read as _, Seek as _, Write as _};
use std::path::Path;

use serde_json::{Map, Value};

use super::error::{Fault, ImportError};
use super::line::{self, BYTE_ORDER_MARK};
use super::mapping::{Mapping, Row};
use exact::budget::{Budget, Exceeded, Limit};
use exact::input;
use json::WithoutNan;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    JsonLines,
    Csv,
    Parquet,
    /// A log of Inspect, `.eval` or `.json`.
    Inspect,
    InspectRobots,
    /// `eval_info.json`, the folder of a data set, or Parquet files of its frames.
    LeRobot,
}

exact::names!(Format {
    JsonLines: "jsonl",
    Csv: "csv",
    Parquet: "parquet",
    Inspect: "inspect",
    InspectRobots: "inspect-robots",
    LeRobot: "lerobot",
});

const UNLIMITED: Limit = Limit::new("bytes of rows", u64::MAX);

/// The bytes of text whose reading and writing costs as much as a value itself.
const VALUE: u64 = 64;

const fn most_rows(bytes: u64) -> Limit {
    Limit::new("bytes of rows of a log of its size, 64 more for each value", 128 << 20).and_beyond(1 << 20, 1024, bytes)
}

/// The number of bytes that identify the kind of a JSON file.
const HEAD: u64 = 64 << 10;

impl Format {
    /// The format by a file's name and first bytes; JSON Lines if they show no other.
    pub fn of_file(path: &Path) -> Self {
        match path.extension().and_then(|ending| ending.to_str()) {
            Some("csv") => Self::Csv,
            Some("parquet") => Self::Parquet,
            Some("eval") => Self::Inspect,
            Some("json") => Self::of_json(path),
            _ => Self::JsonLines,
        }
    }

    fn of_json(path: &Path) -> Self {
        let mut head = Vec::new();
        let _ = input::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
        let head = String::from_utf8_lossy(&head);
        let has = |key: &str| head.contains(key);
        match () {
            () if has("\"inspect_robots_version\"") => Self::InspectRobots,
            () if has("\"per_episode\"") || has("\"per_task\"") => Self::LeRobot,
            () if has("\"eval\"") && has("\"status\"") && has("\"version\"") => Self::Inspect,
            () => Self::JsonLines,
        }
    }

    pub(super) const fn noun(self) -> &'static str {
        if matches!(self, Self::JsonLines) { "line" } else { "row" }
    }

    pub(super) fn read(self, mut file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
        file.rewind().map_err(ImportError::read(&rows.file))?;
        if matches!(self, Self::Inspect | Self::InspectRobots) {
            rows.budget = Budget::new(most_rows(file.metadata().map_err(ImportError::read(&rows.file))?.len()));
        }
        match self {
            Self::JsonLines => Ok(()),
            Self::Csv => csv::read(&file, rows),
            Self::Parquet => parquet::read(file, rows),
            Self::Inspect if inspect::is_archive(&mut file).map_err(ImportError::read(&rows.file))? => {
                inspect::read_archive(file, rows)
            }
            Self::Inspect => json_log::read(WithoutNan::new(file), rows),
            Self::InspectRobots => inspect_robots::read(file, rows),
            Self::LeRobot => lerobot::read(file, rows),
        }
    }
}

/// The destination of rows: a mapping, then a temporary file of lines.
pub(super) struct RowSink<'m> {
    pub(super) file: String,
    /// The first digits of its hash, which keep ids distinct between files that number their episodes from 0.
    pub(super) digits: String,
    pub(super) mapping: &'m mut Mapping,
    /// Values of a sample or of the whole log are repeated in every row.
    pub(super) budget: Budget,
    out: BufWriter<File>,
}

impl<'m> RowSink<'m> {
    pub(super) fn new(file: &str, sha256: &str, mapping: &'m mut Mapping) -> Result<Self, ImportError> {
        let out = tempfile::tempfile().map_err(ImportError::read(file))?;
        let digits = sha256.chars().take(8).collect();
        Ok(Self { file: file.to_owned(), digits, mapping, budget: Budget::new(UNLIMITED), out: BufWriter::new(out) })
    }

    pub(super) fn add(&mut self, row: &Row<'_>) -> Result<(), ImportError> {
        let flat = self.mapping.flat(row);
        let mut line = serde_json::to_vec(&flat).unwrap_or_default();
        line.push(b'\n');
        self.budget
            .spend(line.len() as u64 + VALUE * flat.len() as u64)
            .map_err(|exceeded| self.over("", &exceeded))?;
        self.write(&line)
    }

    pub(super) fn add_object(&mut self, object: &Map<String, Value>) -> Result<(), ImportError> {
        let row: Vec<_> = object.iter().map(|(key, value)| (key.as_str(), value)).collect();
        self.add(&row)
    }

    pub(super) fn add_line(&mut self, line: &[u8]) -> Result<bool, ImportError> {
        let bytes = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line);
        let object = line::members(bytes, true).ok().and_then(|_| serde_json::from_slice(bytes.trim_ascii()).ok());
        match object {
            Some(object) => self.add_object(&object)?,
            None => self.write(bytes)?,
        }
        Ok(!line.is_empty())
    }

    pub(super) fn fault(&self, part: &str, expected: &str, found: impl Into<String>, help: &str) -> ImportError {
        let file = if part.is_empty() { self.file.clone() } else { format!("{}, {part}", self.file) };
        Fault { file, ..Fault::new(expected, found, help) }.into()
    }

    pub(super) fn over(&self, part: &str, exceeded: &Exceeded) -> ImportError {
        self.fault(part, &exceeded.expected(), "more", &Exceeded::help())
    }

    pub(super) fn finish(self) -> Result<File, ImportError> {
        let Self { file, out, .. } = self;
        out.into_inner().map_err(|error| ImportError::read(&file)(error.into_error()))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), ImportError> {
        self.out.write_all(bytes).map_err(ImportError::read(&self.file))
    }
}
