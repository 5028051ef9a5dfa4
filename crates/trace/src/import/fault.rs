//! Faults in lines of steps: line, key, expected, found, remedy.

use std::fmt;
use std::sync::Arc;

use exact::escape::visible;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) file: Arc<str>,
    /// `line` or `row`.
    pub(super) noun: &'static str,
    /// From 1; includes blank lines.
    pub(super) line: u64,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} {}", visible(&self.file), self.noun, self.line)
    }
}

/// One problem of a line, or of a file without lines.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Fault {
    pub file: String,
    pub line: Option<u64>,
    pub noun: &'static str,
    pub key: Option<String>,
    pub expected: String,
    pub found: String,
    pub help: String,
    /// The number of later lines with the same fault.
    pub further_lines: u64,
}

impl Fault {
    pub(super) fn is_alike(&self, other: &Self) -> bool {
        let words = |fault: &Self| (fault.file.clone(), fault.key.clone(), fault.expected.clone());
        self.line.is_some() && other.line.is_some() && words(self) == words(other)
    }

    pub(super) fn of_file(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    pub(super) fn at(self, place: &Place) -> Self {
        Self { file: place.file.to_string(), line: Some(place.line), noun: place.noun, ..self }
    }

    pub(super) fn of_key(self, key: &str) -> Self {
        Self { key: Some(key.to_owned()), ..self }
    }

    pub(super) fn new(expected: impl Into<String>, found: impl Into<String>, help: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into(), help: help.into(), ..Self::default() }
    }
}

/// `steps.jsonl, line 3, key t: expected .., found ..; help`, on four lines.
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", visible(&self.file))?;
        if let Some(line) = self.line {
            write!(f, ", {} {line}", self.noun)?;
        }
        if let Some(key) = &self.key {
            write!(f, ", key `{}`", visible(key))?;
        }
        match self.further_lines {
            0 => {}
            1 => write!(f, ", and in one more {}", self.noun)?,
            more => write!(f, ", and in {more} more {}s", self.noun)?,
        }
        write!(f, "\n  expected {}\n  found {}\n  help: {}", self.expected, self.found, self.help)
    }
}
