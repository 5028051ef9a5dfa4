//! Errors of importing lines of steps: faults (line, key, expected, found, remedy), collected until a pass ends, and
//! other failures.

use std::fmt;
use std::io;
use std::sync::Arc;

use mirrorstats_exact::escape::visible;
use mirrorstats_trace::error::TraceError;
use mirrorstats_trace::schema::domain::is_general;

const MOST_FAULTS: usize = 10;
/// The number of faults in the message; the first one is usually the cause.
const SHOWN: usize = 4;

/// Columns of the mirror's steps. If all are missing, the steps belong to another domain.
const OF_MIRRORS: [&str; 3] = ["body_color", "action", "self_color"];

#[derive(Debug, Default)]
pub(super) struct Faults {
    faults: Vec<Fault>,
    more: usize,
}

impl Faults {
    pub(super) fn add(&mut self, fault: Fault) {
        if let Some(same) = self.faults.iter_mut().find(|kept| kept.repeats(&fault)) {
            same.further_lines += 1;
        } else if self.faults.len() < MOST_FAULTS {
            self.faults.push(fault);
        } else {
            self.more += 1;
        }
    }

    pub(super) fn extend(&mut self, faults: impl IntoIterator<Item = Fault>) {
        faults.into_iter().for_each(|fault| self.add(fault));
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.faults.is_empty()
    }

    pub(super) fn join(&mut self, other: Self) {
        self.extend(other.faults);
        self.more += other.more;
    }

    pub(super) fn check(&mut self) -> Result<(), ImportError> {
        let Self { faults, more } = std::mem::take(self);
        if faults.is_empty() { Ok(()) } else { Err(ImportError::Faults { faults, more }) }
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    #[error("{}", listed(faults, *more))]
    Faults { faults: Vec<Fault>, more: usize },
    #[error("cannot read {file}; check the path and its permissions")]
    Read { file: String, source: io::Error },
    #[error(transparent)]
    Trace(#[from] TraceError),
}

impl ImportError {
    pub(super) fn read(file: &str) -> impl FnOnce(io::Error) -> Self + use<> {
        let file = file.to_owned();
        move |source| Self::Read { file, source }
    }
}

impl From<Fault> for ImportError {
    fn from(fault: Fault) -> Self {
        Self::Faults { faults: vec![fault], more: 0 }
    }
}

fn listed(faults: &[Fault], more: usize) -> String {
    let is_missing = |fault: &Fault| fault.found == "none" || fault.found.starts_with("none, though");
    let lacks = |column: &str| faults.iter().any(|fault| fault.key.as_deref() == Some(column) && is_missing(fault));
    let is_other = OF_MIRRORS.into_iter().all(lacks);
    let is_nested = faults.iter().any(|fault| fault.found == "an object");
    let found = if is_other {
        format!("none of {}", OF_MIRRORS.map(|column| format!("`{column}`")).join(", "))
    } else {
        "objects in its rows".to_owned()
    };
    let cause = (is_other || is_nested).then(|| {
        format!(
            "this looks like another domain: expected columns of the domain `mirror`, found {found}\n  \
             help: give --definitions a file that says `domain = \"NAME\"`; `mirrorstats import --guess FILE` drafts one\n"
        )
    });
    let of_mirror = |fault: &&Fault| !is_other || !is_missing(fault) || fault.key.as_deref().is_none_or(is_general);
    // A value that is there says more than one that is missing.
    let (missing, wrong): (Vec<&Fault>, Vec<&Fault>) = faults.iter().filter(of_mirror).partition(|it| is_missing(it));
    let shown: Vec<String> =
        wrong.into_iter().chain(missing).take(if is_nested { 1 } else { SHOWN }).map(ToString::to_string).collect();
    let more = more + faults.len() - shown.len();
    let more = if more == 0 { String::new() } else { format!("\nand {more} more; nothing was written") };
    format!("{}{}{more}", cause.unwrap_or_default(), shown.join("\n"))
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Location {
    pub(super) file: Arc<str>,
    /// `line` or `row`.
    pub(super) noun: &'static str,
    /// From 1; includes blank lines.
    pub(super) line: u64,
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {} {}", visible(&self.file), self.noun, self.line)
    }
}

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
    pub(super) fn repeats(&self, other: &Self) -> bool {
        let words = |fault: &Self| (fault.file.clone(), fault.key.clone(), fault.expected.clone());
        self.line.is_some() && other.line.is_some() && words(self) == words(other)
    }

    pub(super) fn of_file(file: &str) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }

    pub(super) fn at(self, place: &Location) -> Self {
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
