//! The destination of what formats read: objects become columns, a mapping makes steps of them, and a temporary file
//! keeps these until their types are known.

use std::sync::Arc;

use arrow::array::{Array as _, ArrayRef, Int64Array, RecordBatch};
use indexmap::IndexMap;
use serde_json::Value;

use super::arrays::{Builder, Unreadable, table};
use super::beside::{Beside, StepFile};
use super::columns::TEXT;
use super::error::{Fault, Faults, ImportError};
use super::mapping::{Given, Mapping};
use super::notes::Notes;
use super::source::at;
use super::spool::{Lines, Spool};
use super::value::Cell;
use mirrorstats_exact::budget::{Budget, Exceeded, Limit};
use mirrorstats_trace::schema::COLUMNS;

/// The bytes of text whose reading and writing costs as much as a value itself.
const VALUE: u64 = 64;
/// The most of rows in memory, with what their values take.
const BATCH_BYTES: u64 = 8 << 20;
const BATCH_ROWS: usize = 4096;

/// The path of a row's position: in the innermost list, else in the file, from 0.
const POSITION: &str = "#";

/// A row with its whole reply; the longest reply of a model has some hundred thousand bytes.
pub(super) const LONGEST_LINE: Limit = Limit::new("bytes in a line of steps", 16 << 20);

/// A file of steps is small, and its rows have the values of a row of the log too.
const fn most_beside(bytes: u64) -> Limit {
    Limit::in_proportion("bytes of rows in a file of its size beside a log", 64 << 20, 256, bytes)
}

const fn most_stored(bytes: u64) -> Limit {
    Limit::in_proportion("bytes of rows in a file of its size", 512 << 20, 256, bytes)
}

/// An object around a row, or the row itself, which is the last one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scope<'a> {
    /// The name of the object in paths; of the row itself and of a whole file, none.
    pub(super) name: &'a str,
    pub(super) value: &'a Value,
    /// The position in its list.
    pub(super) index: Option<usize>,
}

impl<'a> Scope<'a> {
    pub(super) const fn new(name: &'a str, value: &'a Value) -> Self {
        Self { name, value, index: None }
    }

    /// The value at a path, which may begin with the name of the object, and does so for one that is in no list. The path
    /// `.` is the object itself.
    pub(super) fn find(&self, path: &str) -> Option<&'a Value> {
        let named = path.strip_prefix(self.name).filter(|rest| !self.name.is_empty() && rest.starts_with('.'));
        match named {
            Some(rest) => at(self.value, &rest[1..]),
            None if path == "." || path == self.name => Some(self.value),
            None if self.name.is_empty() || self.index.is_some() => at(self.value, path),
            None => None,
        }
    }
}

/// The value at a path in these scopes, from the inside; `#` is the position in the innermost list, if there is one.
fn find<'a>(path: &str, scopes: &[Scope<'a>]) -> Cell<'a> {
    let number = |index: Option<usize>| index.and_then(|index| i64::try_from(index).ok()).map_or(Cell::Null, Cell::Int);
    let innermost = scopes.iter().rev().find_map(|scope| scope.index);
    match path.strip_suffix('#') {
        Some("") => return number(innermost),
        Some(name) => return number(scopes.iter().find(|scope| scope.name == name).and_then(|scope| scope.index)),
        None => {}
    }
    let path = path.replace("[#]", &format!(".{}", innermost.unwrap_or_default()));
    scopes.iter().rev().find_map(|scope| scope.find(&path)).map_or(Cell::Null, Cell::of_json)
}

pub(super) struct Rows<'m> {
    pub(super) file: String,
    /// Values of the file: parts of its path, and as `file#` the first digits of its hash, which keep ids distinct
    /// between files that number their episodes from 0.
    given: Given,
    pub(super) mapping: &'m Mapping,
    pub(super) notes: &'m mut Notes,
    /// Values of a sample or of the whole log are repeated in every row.
    pub(super) budget: Budget,
    pub(super) faults: Faults,
    pub(super) noun: &'static str,
    /// True to take lists and objects as values, which a step cannot have.
    pub(super) is_strict: bool,
    pub(super) beside: Beside,
    /// The file beside the log whose steps are read; the row of the log is then in the scope before the last.
    steps_of: Option<Arc<str>>,
    spool: Spool,
    /// The line of the last row.
    total: u64,
    added: u64,
    columns: IndexMap<String, Builder>,
    /// The line of each row that is in memory.
    lines: Vec<u64>,
    bytes: u64,
    /// The required columns that these rows have: a missing one is not a null.
    required: Vec<&'static str>,
}

impl<'m> Rows<'m> {
    pub(super) fn new(
        file: &str,
        given: Given,
        bytes: u64,
        mapping: &'m Mapping,
        notes: &'m mut Notes,
    ) -> Result<Self, ImportError> {
        Ok(Self {
            file: file.to_owned(),
            given,
            mapping,
            notes,
            budget: Budget::new(most_stored(bytes)),
            faults: Faults::default(),
            noun: "row",
            is_strict: false,
            beside: Beside::default(),
            steps_of: None,
            spool: Spool::new().map_err(ImportError::read(file))?,
            total: 0,
            added: 0,
            columns: IndexMap::new(),
            lines: Vec::new(),
            bytes: 0,
            required: Vec::new(),
        })
    }

    pub(super) const fn next_line(&self) -> u64 {
        self.total + 1
    }

    /// Adds the row in the last scope: its plain values, and what the mapping reads in all scopes.
    pub(super) fn add(&mut self, scopes: &[Scope<'_>]) -> Result<(), ImportError> {
        self.add_line(scopes, self.next_line())
    }

    /// The file of the steps of the row in the last scope; `None` if the row has none, or if it is missing.
    pub(super) fn steps_beside(&mut self, scopes: &[Scope<'_>], line: u64) -> Result<Option<StepFile>, ImportError> {
        let Some(steps) = &self.mapping.steps else { return Ok(None) };
        let Some(path) = steps.filled(steps.paths().map(|path| find(&path.keys, scopes))) else { return Ok(None) };
        let row = format!("{}, {} {line}", self.file, self.noun);
        self.beside.open(&path, &row)
    }

    /// Reads the rows of the file with the steps of a row, and returns their number.
    pub(super) fn within(
        &mut self,
        name: &str,
        bytes: u64,
        line: u64,
        read: impl FnOnce(&mut Self) -> Result<(), ImportError>,
    ) -> Result<u64, ImportError> {
        self.flush()?;
        let before = self.added;
        let noun = self.noun;
        let log = std::mem::replace(&mut self.file, name.to_owned());
        let budget = std::mem::replace(&mut self.budget, Budget::new(most_beside(bytes)));
        (self.noun, self.steps_of) = ("line", Some(name.into()));
        read(self)?;
        self.flush()?;
        (self.file, self.budget, self.steps_of) = (log, budget, None);
        (self.noun, self.total) = (noun, line);
        Ok(self.added - before)
    }

    pub(super) fn add_line(&mut self, scopes: &[Scope<'_>], line: u64) -> Result<(), ImportError> {
        let mapping = self.mapping;
        let mut skipped = mapping.settings.skip.iter();
        let is_there = |(path, value): &(&String, &Value)| {
            if path.ends_with('#') {
                find(path, scopes) == Cell::of_json(value)
            } else {
                scopes.iter().rev().find_map(|scope| scope.find(path)) == Some(*value)
            }
        };
        if let Some((path, value)) = skipped.find(is_there) {
            self.notes.count(format!("rows whose `{path}` is {value}"), 1);
            return Ok(());
        }
        let mut values: Vec<(String, Cell<'_>)> = Vec::new();
        let is_nested = |value: &Value| value.is_array() || value.is_object();
        let (of_row, of_step) = match &self.steps_of {
            Some(_) => (scopes.iter().rev().nth(1), scopes.last()),
            None => (scopes.last(), None),
        };
        for (scope, prefix) in
            of_step.map(|scope| (scope, "")).into_iter().chain(of_row.map(|scope| (scope, &*mapping.settings.others)))
        {
            for (key, value) in scope.value.as_object().into_iter().flatten() {
                let name = format!("{prefix}{key}");
                if is_nested(value) && !self.is_strict {
                    if !mapping.reads(key) {
                        self.notes.leave_out(key, 1);
                    }
                } else if of_step.is_none() || !values.iter().any(|(known, _)| *known == name) {
                    values.push((name, Cell::of_json(value)));
                }
            }
        }
        let is_left_out =
            |scope: &Scope<'_>| !scope.name.is_empty() && is_nested(scope.value) && !mapping.reads(scope.name);
        for scope in scopes.iter().filter(|scope| is_left_out(scope)) {
            self.notes.leave_out(scope.name, 1);
        }
        let paths = mapping.paths().filter(|path| !self.given.contains_key(*path));
        let in_file = i64::try_from(line).map_or(Cell::Null, |line| Cell::Int(line - 1));
        let is_listed = scopes.iter().any(|scope| scope.index.is_some());
        let at = |path: &str| if path == POSITION && !is_listed { in_file.clone() } else { find(path, scopes) };
        let found = paths.map(|path| (path.to_owned(), at(path)));
        let found: Vec<_> = found.filter(|(path, _)| !values.iter().any(|(key, _)| key == path)).collect();
        values.extend(found);
        self.push(values, line)
    }

    fn push(&mut self, values: Vec<(String, Cell<'_>)>, line: u64) -> Result<(), ImportError> {
        let bytes = values.iter().map(|(key, value)| (key.len() + value.bytes()) as u64).sum::<u64>();
        let work = bytes + VALUE * values.len() as u64;
        let counted = LONGEST_LINE.check(bytes).and_then(|()| self.budget.spend(work));
        counted.map_err(|exceeded| self.over("", &exceeded))?;
        let has = |name: &str| values.iter().any(|(key, _)| key == name);
        let required = COLUMNS.iter().filter(|column| column.required || column.name == TEXT);
        let required: Vec<_> = required.map(|column| column.name).filter(|name| has(name)).collect();
        let fits = |(key, value): &(String, Cell<'_>)| self.columns.get(key).is_none_or(|column| column.takes(value));
        if self.lines.len() == BATCH_ROWS
            || self.bytes + work > BATCH_BYTES
            || required != self.required
            || !values.iter().all(fits)
        {
            self.flush()?;
        }
        self.required = required;
        let row = self.lines.len();
        for (key, value) in values {
            self.columns.entry(key).or_insert_with(|| Builder::new(row)).push(row, value);
        }
        self.lines.push(line);
        self.total = line;
        self.added += 1;
        self.bytes += work;
        Ok(())
    }

    /// Maps and stores the rows in memory.
    fn flush(&mut self) -> Result<(), ImportError> {
        if self.lines.is_empty() {
            return Ok(());
        }
        let (columns, lines) = (std::mem::take(&mut self.columns), std::mem::take(&mut self.lines));
        let count = lines.len();
        let columns = columns.into_iter().map(|(name, column)| (name, column.finish(count))).collect();
        self.bytes = 0;
        self.store(&table(columns, count), Lines::of(lines))
    }

    /// Adds the rows of a table.
    pub(super) fn add_table(&mut self, table: &RecordBatch) -> Result<(), ImportError> {
        let first = self.total + 1;
        let table = &self.numbered(table);
        for (field, values) in table.schema_ref().fields().iter().zip(table.columns()) {
            if values.data_type().is_nested() && !self.mapping.reads(field.name()) {
                self.notes.leave_out(field.name(), (values.len() - values.null_count()) as u64);
            }
        }
        self.total += table.num_rows() as u64;
        self.store(table, Lines::From(first))
    }

    /// The table with the position of each row in its file, if the mapping reads it.
    fn numbered(&self, rows: &RecordBatch) -> RecordBatch {
        if !self.mapping.paths().any(|path| path == POSITION) || rows.column_by_name(POSITION).is_some() {
            return rows.clone();
        }
        let positions = (self.total..).take(rows.num_rows()).map(u64::cast_signed);
        let positions: ArrayRef = Arc::new(positions.collect::<Int64Array>());
        let names = rows.schema_ref().fields().iter().map(|field| field.name().clone());
        let columns = names.zip(rows.columns().iter().cloned()).chain([(POSITION.to_owned(), positions)]).collect();
        table(columns, rows.num_rows())
    }

    fn store(&mut self, table: &RecordBatch, lines: Lines) -> Result<(), ImportError> {
        let rows = self.mapping.apply(table, &self.given);
        let rows = rows.map_err(|(name, Unreadable { row, expected, found })| {
            let help = "correct the value, or leave the column out: `--set COLUMN=VALUE` replaces it";
            let line = Some(lines.at(row));
            Fault { file: self.file.clone(), line, noun: self.noun, ..Fault::new(expected, found, help).of_key(&name) }
        })?;
        self.spool.add(&rows, lines, self.steps_of.clone()).map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &arrow::error::ArrowError) -> ImportError {
        ImportError::read(&self.file)(std::io::Error::other(error.to_string()))
    }

    pub(super) fn fault(&self, part: &str, expected: &str, found: impl Into<String>, help: &str) -> ImportError {
        let file = if part.is_empty() { self.file.clone() } else { format!("{}, {part}", self.file) };
        Fault { file, ..Fault::new(expected, found, help) }.into()
    }

    pub(super) fn over(&self, part: &str, exceeded: &Exceeded) -> ImportError {
        self.fault(part, &exceeded.expected(), "more", &Exceeded::help())
    }

    /// The stored rows, the faults, and the hash of the files beside the log.
    pub(super) fn finish(mut self) -> Result<(Spool, Faults, Option<String>), ImportError> {
        self.flush()?;
        let beside = self.beside.finish(self.notes);
        Ok((self.spool, self.faults, beside))
    }
}
