//! Answers on standard output, and files that appear whole or not at all.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;

use serde::Serialize;
use tempfile::NamedTempFile;

use super::outcome::{Failure, Outcome};
use crate::base::temporary;
use crate::base::visible::visible_lines;

/// Prints an answer, as text for people or as JSON for programs.
///
/// # Errors
/// When standard output cannot be written.
pub fn print<T: Display + Serialize>(answer: &T, json: bool) -> Result<Outcome, Failure> {
    if json {
        return print_json(answer);
    }
    writeln!(io::stdout().lock(), "{}", visible_lines(answer.to_string().trim_end()))?;
    Ok(Outcome::Done)
}

/// Prints an answer as JSON.
///
/// # Errors
/// When standard output cannot be written.
pub fn print_json<T: Serialize>(answer: &T) -> Result<Outcome, Failure> {
    let mut out = io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, answer).map_err(io::Error::from)?;
    writeln!(out)?;
    Ok(Outcome::Done)
}

/// Says something on standard error that is neither an answer nor a fault.
pub fn note(words: &str) {
    say(&format!("note: {words}"));
}

/// Says how a command went on standard error. With standard error closed there is nobody to tell, and the work goes on.
pub fn say(words: &str) {
    let _ = writeln!(io::stderr(), "{}", visible_lines(words));
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// When the folder is not there or not writable, or the disk is full; the error names the file.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    write_file_with(path, |file| Ok(file.write_all(bytes)?))
}

/// Writes a file as `write` does, whole or not at all.
///
/// # Errors
/// When the folder is not there or not writable, or the disk is full; the error names the file. What `write` gives.
pub fn write_file_with(path: &Path, write: impl FnOnce(&mut File) -> Result<(), Failure>) -> Result<(), Failure> {
    let mut file = beside(path)?;
    write(file.as_file_mut()).map_err(|failure| match failure {
        Failure::Output(error) => unwritable(path, error),
        other => other,
    })?;
    persist(file, path)
}

/// A temporary file in the folder of `path`.
///
/// # Errors
/// When the folder is not there or not writable.
pub fn beside(path: &Path) -> Result<NamedTempFile, Failure> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    temporary::file_in(folder).map_err(|error| unwritable(path, error))
}

/// Gives a temporary file its name.
///
/// # Errors
/// When the name cannot be taken.
pub fn persist(file: NamedTempFile, path: &Path) -> Result<(), Failure> {
    file.persist(path).map(|_| ()).map_err(|error| unwritable(path, error.error))
}

fn unwritable(path: &Path, error: io::Error) -> Failure {
    Failure::Rendered(format!(
        "error: cannot write `{}`: {}\n  help: is the folder there and writable, and the disk not full?",
        path.display(),
        temporary::without_name(error)
    ))
}
