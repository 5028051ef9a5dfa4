//! Files with one JSON object per line.

use std::io;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;

/// The objects of a file; empty if it does not exist. A line that was cut off, or has another form, is left out.
pub fn read<T: DeserializeOwned>(path: &Path, longest: Limit) -> io::Result<Vec<T>> {
    let lines = match input::lines(path, longest) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        lines => lines?,
    };
    let mut objects = Vec::new();
    for line in lines {
        objects.extend(serde_json::from_slice(&line?).ok());
    }
    Ok(objects)
}

pub fn line(object: &impl Serialize) -> serde_json::Result<Vec<u8>> {
    let mut line = serde_json::to_vec(object)?;
    line.push(b'\n');
    Ok(line)
}

pub fn replace<T: Serialize>(path: &Path, objects: &[T]) -> io::Result<()> {
    let lines: Vec<Vec<u8>> = objects.iter().map(line).collect::<serde_json::Result<_>>()?;
    mirrorstats_exact::replace::replace(path, &lines.concat())
}
