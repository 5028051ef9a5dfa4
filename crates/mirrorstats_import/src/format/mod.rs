//! Reads files of other harnesses as rows. Each format has one file; all rows become lines of steps by one mapping.
//!
//! Rule: keys that a format does not give are absent or null. Records that are not steps are counted and named.

mod csv;
mod inspect;
mod inspect_robots;
pub(super) mod json;
mod json_list;
mod json_log;
pub(super) mod lerobot;
mod parquet;

use std::fs::File;
use std::io::{BufWriter, Seek as _, Write as _};

use arrow::array::{Array as _, RecordBatch};
use serde_json::{Map, Value};

use super::error::{Fault, ImportError};
use super::line::{self, BYTE_ORDER_MARK, LONGEST_LINE, Line};
use super::mapping::{MappedColumn, Mapping, Row};
use super::table::Unreadable;
use super::value::LineValue;
use json::PythonJson;
use mirrorstats_exact::budget::{Budget, Exceeded, Limit};

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

mirrorstats_exact::names!(Format {
    JsonLines: "jsonl",
    Csv: "csv",
    Parquet: "parquet",
    Inspect: "inspect",
    InspectRobots: "inspect-robots",
    LeRobot: "lerobot",
});

/// The bytes of text whose reading and writing costs as much as a value itself.
const VALUE: u64 = 64;

const fn most_rows(bytes: u64) -> Limit {
    Limit::new("bytes of rows of a log of its size, 64 more for each value", 128 << 20).and_beyond(1 << 20, 1024, bytes)
}

const fn most_stored(bytes: u64) -> Limit {
    Limit::in_proportion("bytes of rows in a file of its size", 512 << 20, 256, bytes)
}

/// The number of bytes that identify the kind of a JSON file.
pub(super) const HEAD: u64 = 64 << 10;

/// Endings of compressed files, whose contents have the format before it.
const COMPRESSED: [&str; 3] = [".gz", ".zst", ".zstd"];

impl Format {
    /// The format by a file's first bytes, then by its name; JSON Lines if they show no other.
    pub(super) fn detect(name: &str, head: &[u8]) -> Self {
        let name = name.to_ascii_lowercase();
        let name = COMPRESSED.iter().find_map(|ending| name.strip_suffix(ending)).unwrap_or(&name);
        let text = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head).trim_ascii_start();
        match name.rsplit_once('.').map(|(_, ending)| ending) {
            _ if head.starts_with(b"PAR1") => Self::Parquet,
            _ if head.starts_with(b"PK\x03\x04") => Self::Inspect,
            _ if text.starts_with(b"{") => Self::of_json(&String::from_utf8_lossy(head)),
            _ if text.starts_with(b"[") => Self::JsonLines,
            Some("csv" | "tsv") => Self::Csv,
            Some("parquet" | "parq" | "pq") => Self::Parquet,
            Some("eval") => Self::Inspect,
            _ => Self::JsonLines,
        }
    }

    fn of_json(head: &str) -> Self {
        let has = |key: &str| head.contains(key);
        match () {
            () if has("\"inspect_robots_version\"") => Self::InspectRobots,
            () if has("\"per_episode\"") || has("\"per_task\"") => Self::LeRobot,
            () if has("\"eval\"") && has("\"status\"") && has("\"version\"") => Self::Inspect,
            () => Self::JsonLines,
        }
    }

    pub(super) fn read(self, mut file: File, rows: &mut RowSink<'_>) -> Result<(), ImportError> {
        file.rewind().map_err(ImportError::read(&rows.file))?;
        if matches!(self, Self::Inspect | Self::InspectRobots) {
            rows.budget = Budget::new(most_rows(file.metadata().map_err(ImportError::read(&rows.file))?.len()));
        }
        match self {
            Self::JsonLines => json_list::read(file, rows),
            Self::Csv => csv::read(&file, rows),
            Self::Parquet => parquet::read(file, rows),
            Self::Inspect if inspect::is_archive(&mut file).map_err(ImportError::read(&rows.file))? => {
                inspect::read_archive(file, rows)
            }
            Self::Inspect => json_log::read(PythonJson::new(file), rows),
            Self::InspectRobots => inspect_robots::read(file, rows),
            Self::LeRobot => lerobot::read(file, rows),
        }
    }
}

/// The destination of rows: a mapping, then a temporary file of typed values, each row behind its length.
pub(super) struct RowSink<'m> {
    pub(super) file: String,
    /// The first digits of its hash, which keep ids distinct between files that number their episodes from 0.
    pub(super) digits: String,
    pub(super) mapping: &'m mut Mapping,
    /// Values of a sample or of the whole log are repeated in every row.
    pub(super) budget: Budget,
    out: BufWriter<File>,
    rows: u64,
}

impl<'m> RowSink<'m> {
    pub(super) fn new(file: &str, bytes: u64, sha256: &str, mapping: &'m mut Mapping) -> Result<Self, ImportError> {
        let out = BufWriter::new(tempfile::tempfile().map_err(ImportError::read(file))?);
        let digits = sha256.chars().take(8).collect();
        Ok(Self { file: file.to_owned(), digits, mapping, budget: Budget::new(most_stored(bytes)), out, rows: 0 })
    }

    pub(super) fn add(&mut self, row: &Row<'_>) -> Result<(), ImportError> {
        let flat = self.mapping.flat(row);
        self.budget.spend(VALUE * flat.len() as u64).map_err(|exceeded| self.over("", &exceeded))?;
        self.store(flat)
    }

    pub(super) fn add_object(&mut self, object: &Map<String, Value>) -> Result<(), ImportError> {
        let row: Vec<_> = object.iter().map(|(key, value)| (key.as_str(), value)).collect();
        self.add(&row)
    }

    pub(super) fn add_cells(&mut self, row: &[(&str, LineValue)]) -> Result<(), ImportError> {
        let flat = self.mapping.flat_cells(row);
        self.store(flat)
    }

    pub(super) fn add_table(&mut self, table: &RecordBatch) -> Result<(), ImportError> {
        for (field, values) in table.schema_ref().fields().iter().zip(table.columns()) {
            if values.data_type().is_nested() && !self.mapping.reads(field.name()) {
                self.mapping.leave_out(field.name(), (values.len() - values.null_count()) as u64);
            }
        }
        let refused = |(name, Unreadable { row, expected, found }): (&str, Unreadable)| {
            let (file, line) = (self.file.clone(), Some(self.rows + row as u64 + 1));
            let help = "correct the value, or leave the column out: `--set COLUMN=VALUE` replaces it";
            let fault = Fault { file, line, noun: "row", ..Fault::new(expected, found, help) };
            ImportError::from(fault.of_key(name))
        };
        let columns = self.mapping.columns(table).map_err(refused)?;
        let constants: Vec<_> = self.mapping.constants().collect();
        let mut rows = Vec::with_capacity(table.num_rows());
        for row in 0..table.num_rows() {
            let value = |column: &MappedColumn<'_>| {
                let value = column.at(row).map_err(|unreadable| refused((column.name, unreadable)))?;
                Ok::<_, ImportError>((column.name.to_owned(), value))
            };
            let values = columns.iter().map(value).collect::<Result<Vec<_>, _>>()?;
            rows.push(line::to_record(&values.into_iter().chain(constants.iter().cloned()).collect()));
        }
        rows.iter().try_for_each(|row| self.write(row))
    }

    /// A line of JSON. The blank lines before it count, so that rows have the numbers of their lines.
    pub(super) fn add_line(&mut self, line: &Line) -> Result<(), ImportError> {
        let pairs = line::pairs(&line.bytes, line.ended).map_err(|fault| fault.at(&line.place))?;
        while self.rows + 1 < line.place.line {
            self.write(&[])?;
        }
        self.add(&pairs.row())
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

    fn store(&mut self, row: impl IntoIterator<Item = (String, LineValue)>) -> Result<(), ImportError> {
        let row: Vec<_> = row.into_iter().collect();
        self.write(&line::to_record(&row))
    }

    fn write(&mut self, record: &[u8]) -> Result<(), ImportError> {
        let length = u32::try_from(record.len()).unwrap_or(u32::MAX);
        let counted = LONGEST_LINE.check(length.into()).and_then(|()| self.budget.spend(length.into()));
        counted.map_err(|exceeded| self.over("", &exceeded))?;
        self.rows += 1;
        let written = self.out.write_all(&length.to_le_bytes()).and_then(|()| self.out.write_all(record));
        written.map_err(ImportError::read(&self.file))
    }
}
