//! Errors with the words of the command line, as `mirrorstats.Error`.

use std::error::Error;
use std::io;
use std::path::Path;

use mirrorstats::StudyError;
use mirrorstats::cli::{ErrorAnswer, Failure};
use pyo3::prelude::*;

/// An error of a study.
pub fn of_study(error: StudyError) -> PyErr {
    of_failure(&error.into())
}

/// An error of the library that the command line tells as it is.
pub fn of_input(error: impl Into<Box<dyn Error + Send + Sync>>) -> PyErr {
    of_failure(&Failure::input(error))
}

/// A file that cannot be written.
pub fn of_writing(path: &Path, fault: &io::Error) -> PyErr {
    let help = "is the folder there and writable, and the disk not full?";
    of_input(format!("cannot write `{}`: {fault}\n  help: {help}", path.display()))
}

/// What the command line would say, and the code that it would end with.
pub fn of_failure(failure: &Failure) -> PyErr {
    let ErrorAnswer { error, code, faults } = ErrorAnswer::of(failure);
    let faults = serde_json::to_string(&faults).unwrap_or_default();
    Python::attach(|py| {
        let raised = || py.import("mirrorstats._error")?.getattr("of_words")?.call1((error, code, faults));
        match raised() {
            Ok(raised) => PyErr::from_value(raised),
            Err(fault) => fault,
        }
    })
}
