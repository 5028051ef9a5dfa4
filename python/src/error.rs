//! Converts errors to `mirrorstats.Error`, with the messages of the command line.

use std::error::Error;
use std::io;
use std::path::Path;

use mirrorstats::cli::{ErrorAnswer, Failure};
use mirrorstats::{ErrorKind, StudyError};
use mirrorstats_import::{Fault, ImportError};
use mirrorstats_toml_spec::{FaultRecord, Faults};
use pyo3::prelude::*;

/// The error of a study, in the class that shows what to change.
pub fn of_study(error: StudyError) -> PyErr {
    let kind = kind(&error);
    if let Some(ImportError::Faults { faults, more }) = error.cause() {
        return raised(kind, &in_rows(faults, *more), &[]);
    }
    of_failure(&error.into(), kind)
}

fn kind(error: &StudyError) -> &'static str {
    if let Some(faults) = Faults::of(error) {
        let is_query = faults.records().iter().any(|fault| fault.file == "query");
        return if is_query { "QueryError" } else { "DefinitionError" };
    }
    match error.kind {
        ErrorKind::Input => "InputError",
        ErrorKind::Definitions => "DefinitionError",
        ErrorKind::Argument => "ArgumentError",
        ErrorKind::Query => "QueryError",
        ErrorKind::Output => "OutputError",
    }
}

/// The message for faults in rows: a data frame has no lines, and its rows count from 0.
fn in_rows(faults: &[Fault], more: usize) -> String {
    let one = |fault: &Fault| {
        let row = fault.line.map_or_else(String::new, |line| format!("row {} (from 0)", line - 1));
        let column = fault.key.as_ref().map_or_else(String::new, |key| format!("column `{key}`"));
        let place: Vec<String> = [row, column].into_iter().filter(|part| !part.is_empty()).collect();
        let place = if place.is_empty() { "the rows".to_owned() } else { place.join(", ") };
        let further = match fault.further_lines {
            0 => String::new(),
            1 => ", and 1 more row".to_owned(),
            more => format!(", and {more} more rows"),
        };
        format!("{place}{further}: expected {}, found {}\n  help: {}", fault.expected, fault.found, fault.help)
    };
    let text = faults.iter().map(one).collect::<Vec<_>>().join("\n");
    if more == 0 { text } else { format!("{text}\nand {more} more") }
}

/// The library's error, with the message of the command line.
pub fn of_input(error: impl Into<Box<dyn Error + Send + Sync>>) -> PyErr {
    of_failure(&Failure::input(error), "InputError")
}

pub fn of_argument(error: impl Into<Box<dyn Error + Send + Sync>>) -> PyErr {
    of_failure(&Failure::input(error), "ArgumentError")
}

pub fn of_writing(path: &Path, fault: &io::Error) -> PyErr {
    let help = "is the folder there and writable, and the disk not full?";
    raised("OutputError", &format!("cannot write `{}`: {fault}\n  help: {help}", path.display()), &[])
}

pub fn of_failure(failure: &Failure, kind: &str) -> PyErr {
    let ErrorAnswer { error, faults, .. } = ErrorAnswer::of(failure);
    raised(kind, &error, &faults)
}

fn raised(kind: &str, words: &str, faults: &[FaultRecord]) -> PyErr {
    let faults = serde_json::to_string(faults).unwrap_or_default();
    Python::attach(|py| {
        let raised = || py.import("mirrorstats._error")?.getattr("of_words")?.call1((kind, words, faults));
        match raised() {
            Ok(raised) => PyErr::from_value(raised),
            Err(fault) => fault,
        }
    })
}
