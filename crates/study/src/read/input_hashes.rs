//! The inputs of a report with their hashes, computed in parallel with the scan.

use std::io;
use std::path::Path;

use crate::error::StudyError;
use exact::{self, hash};
use report::bundle;
use trace::inputs::Input;

pub(crate) fn hashes(inputs: &[Input]) -> Result<Vec<bundle::Input>, StudyError> {
    inputs.iter().map(hash_of).collect()
}

pub(crate) fn of_file(path: &Path) -> io::Result<String> {
    hash::of_reader(exact::input::open(path)?)
}

fn hash_of(input: &Input) -> Result<bundle::Input, StudyError> {
    let read = || {
        let file = exact::input::open(&input.path)?;
        let bytes = file.metadata()?.len();
        Ok::<_, io::Error>((hash::of_reader(file)?, bytes))
    };
    let (sha256, bytes) = read().map_err(|error| StudyError::file(&input.name, error))?;
    Ok(bundle::Input::new(input.name.as_ref(), sha256, bytes))
}
