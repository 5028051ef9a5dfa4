//! Answers on standard output, and files that appear whole or not at all.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;

use serde::Serialize;

use super::outcome::{Failure, Outcome};
use crate::base::temporary;

/// Prints an answer, as text for people or as JSON for programs.
///
/// # Errors
/// When standard output cannot be written.
pub fn print<T: Display + Serialize>(answer: &T, json: bool) -> Result<Outcome, Failure> {
    if json {
        return print_json(answer);
    }
    writeln!(io::stdout().lock(), "{}", answer.to_string().trim_end())?;
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
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    let mut file = builder
        .prefix(".mirrorstats-")
        .permissions_of_new_files()
        .tempfile_in(folder)
        .map_err(|error| unwritten(path, error))?;
    write(file.as_file_mut()).map_err(|failure| match failure {
        Failure::Output(error) => unwritten(path, error),
        other => other,
    })?;
    file.persist(path).map(drop).map_err(|error| unwritten(path, error.error))
}

/// That a file could not be written.
fn unwritten(path: &Path, error: io::Error) -> Failure {
    Failure::Rendered(format!(
        "error: cannot write `{}`: {}\n  help: is the folder there and writable, and the disk not full?",
        path.display(),
        temporary::without_name(error)
    ))
}

/// Files as any program makes them, where a temporary file is private.
trait NewFilePermissions {
    fn permissions_of_new_files(&mut self) -> &mut Self;
}

impl NewFilePermissions for tempfile::Builder<'_, '_> {
    #[cfg(unix)]
    fn permissions_of_new_files(&mut self) -> &mut Self {
        use std::os::unix::fs::PermissionsExt as _;
        // The process's umask takes away from these, as with any other file.
        self.permissions(std::fs::Permissions::from_mode(0o666))
    }

    #[cfg(not(unix))]
    fn permissions_of_new_files(&mut self) -> &mut Self {
        self
    }
}
