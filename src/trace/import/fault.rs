//! What can be wrong with lines of steps: which line, which key, expected, found, what to do.

use std::fmt;
use std::io;
use std::sync::Arc;

use super::super::finding::TraceError;
use crate::base::escape::visible;

/// A line of a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) file: Arc<str>,
    /// From 1; blank lines count.
    pub(super) line: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, line {}", visible(&self.file), self.line)
    }
}

/// One thing that is wrong with a line, or with a file if it has no line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fault {
    /// The file, as it was named.
    pub file: String,
    /// The line, from 1.
    pub line: Option<u64>,
    /// The key of the object.
    pub key: Option<String>,
    /// What would do.
    pub expected: String,
    /// What is there.
    pub found: String,
    /// What to do about it.
    pub help: String,
}

impl Fault {
    /// A fault of a whole file, its words still to be said.
    pub(super) fn of_file(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    /// The same fault, in this line.
    pub(super) fn at(self, place: &Place) -> Self {
        Self { file: place.file.to_string(), line: Some(place.line), ..self }
    }

    /// The same fault, of this key.
    pub(super) fn of_key(self, key: &str) -> Self {
        Self { key: Some(key.to_owned()), ..self }
    }

    /// A fault without its place.
    pub(super) fn new(expected: impl Into<String>, found: impl Into<String>, help: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into(), help: help.into(), ..Self::default() }
    }
}

/// `steps.jsonl, line 3, key t: expected .., found ..; help`, on four lines.
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", visible(&self.file))?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(key) = &self.key {
            write!(f, ", key `{}`", visible(key))?;
        }
        write!(f, "\n  expected {}\n  found {}\n  help: {}", self.expected, self.found, self.help)
    }
}

/// The most faults that a message tells one by one.
const TOLD: usize = 10;

/// The faults so far: the first of them, and how many there are.
#[derive(Debug, Default)]
pub(super) struct Faults {
    told: Vec<Fault>,
    more: usize,
}

impl Faults {
    pub(super) fn add(&mut self, fault: Fault) {
        if self.told.len() < TOLD {
            self.told.push(fault);
        } else {
            self.more += 1;
        }
    }

    pub(super) fn extend(&mut self, faults: impl IntoIterator<Item = Fault>) {
        faults.into_iter().for_each(|fault| self.add(fault));
    }

    /// The error of these faults, if there are any.
    pub(super) fn none(&mut self) -> Result<(), ImportError> {
        let Self { told, more } = std::mem::take(self);
        if told.is_empty() { Ok(()) } else { Err(ImportError::Faults { told, more }) }
    }
}

/// Why lines of steps did not become a trace.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Lines that are no steps, or steps that are no episodes.
    #[error("{}", listed(told, *more))]
    Faults {
        /// The first of them; never empty.
        told: Vec<Fault>,
        /// How many more there are.
        more: usize,
    },
    /// A text cannot be read.
    #[error("cannot read {file}; check the path and its permissions")]
    Read {
        /// As it was named.
        file: String,
        /// Why not.
        source: io::Error,
    },
    /// A text is not what it was a moment before.
    #[error("{file}: expected the lines of the first pass, found others\n  help: import it when nothing writes to it")]
    Changed {
        /// As it was named.
        file: String,
    },
    /// The trace cannot be written, or breaks a rule of the schema.
    #[error(transparent)]
    Trace(#[from] TraceError),
}

impl ImportError {
    pub(super) fn changed(file: &str) -> Self {
        Self::Changed { file: file.to_owned() }
    }

    pub(super) fn read(file: &str) -> impl FnOnce(io::Error) -> Self {
        let file = file.to_owned();
        move |source| Self::Read { file, source }
    }
}

fn listed(told: &[Fault], more: usize) -> String {
    let told = told.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    match more {
        0 => told,
        more => format!("{told}\nand {more} more; nothing was written"),
    }
}
