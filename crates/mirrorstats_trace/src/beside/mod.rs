//! Lists beside the traces, one JSON object per line: the labels of coders, and the lost episodes.

pub mod label_line;
pub mod labels;
pub mod lost;

use std::io;
use std::path::{Path, PathBuf};

use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_exact::input;

#[derive(Debug, thiserror::Error)]
pub enum ListError {
    #[error("cannot read {}: {source}", .path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("cannot write {}: {source}\n  help: is the folder writable, and the disk not full?", .path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error("{}, line {line}: {problem}\n  help: {help}", .path.display())]
    Line { path: PathBuf, line: usize, problem: String, help: &'static str },
    #[error("{}: {source}", .path.display())]
    Budget { path: PathBuf, source: Exceeded },
}

/// The lines of a list, with line feeds; none if the file does not exist.
fn lines(list: &Path, longest: Limit) -> Result<impl Iterator<Item = Result<Vec<u8>, ListError>>, ListError> {
    let failed = move |source| ListError::Read { path: list.to_owned(), source };
    let lines = match input::lines(list, longest) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        lines => Some(lines.map_err(failed)?),
    };
    Ok(lines.into_iter().flatten().map(move |line| line.map_err(failed)))
}

/// The lines of a list with their numbers, except blank ones.
fn numbered_lines(
    list: &Path,
    longest: Limit,
) -> Result<impl Iterator<Item = Result<(usize, Vec<u8>), ListError>>, ListError> {
    let numbered = lines(list, longest)?.zip(1..).map(|(line, number)| line.map(|line| (number, line)));
    Ok(numbered.filter(|line| !matches!(line, Ok((_, text)) if text.trim_ascii().is_empty())))
}
