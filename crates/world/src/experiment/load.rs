//! Loads experiment files.

use std::io;
use std::path::{Path, PathBuf};

use super::file;
use super::table::Entry;
use super::{Experiment, built_in_specs};
use exact::budget::Limit;
use exact::input;
use toml_spec::{Faults, Place, Source};

const LARGEST: Limit = Limit::new("bytes of an experiment file", 1 << 20);
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    #[error(
        "cannot read the experiment file `{}`: {source}\n  help: an experiment file is TOML text; \
         `mirrorstats experiments show E1` prints one",
        path.display()
    )]
    Unreadable { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Faults(#[from] Faults),
}

/// An experiment of a file, and its locations there.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub experiment: Experiment,
    /// The location of its cubes, or of its name if it does not mention cubes.
    pub cubes: Place,
    pub mirrors: Vec<Place>,
    pub name: Place,
}

pub fn load(path: &Path) -> Result<Vec<Loaded>, FileError> {
    let text = input::text(path, LARGEST).map_err(|source| FileError::Unreadable { path: path.to_owned(), source })?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let source = Source { name: path.display().to_string(), text };
    let entries = file::read(source, Some(folder), &built_in_specs())?;
    let loaded = entries.into_iter().enumerate().map(|(place, Entry { known, name, cubes, mirrors })| Loaded {
        experiment: Experiment::of_file(place, known),
        cubes,
        mirrors,
        name,
    });
    Ok(loaded.collect())
}
