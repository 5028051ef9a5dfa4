//! Lists beside the traces, one JSON object per line: the labels of coders, and the lost episodes.

pub mod label_line;
pub mod labels;
pub mod lost;

use std::io;
use std::path::Path;

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;

/// The lines of a list with their numbers, except blank ones; none if the file does not exist.
fn numbered_lines(
    list: &Path,
    longest: Limit,
) -> io::Result<impl Iterator<Item = io::Result<(usize, Vec<u8>)>> + use<>> {
    let lines = match input::lines(list, longest) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        lines => Some(lines?),
    };
    let numbered = lines.into_iter().flatten().zip(1..).map(|(line, number)| line.map(|line| (number, line)));
    Ok(numbered.filter(|line| !matches!(line, Ok((_, text)) if text.trim_ascii().is_empty())))
}
