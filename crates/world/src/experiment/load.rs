//! Files of experiments, which become known to the process.

use std::io;
use std::path::{Path, PathBuf};

use super::file;
use super::table::Entry;
use super::{Experiment, TooMany, built_in_specs};
use exact::budget::Limit;
use exact::input;
use toml_spec::{Faults, Place, Source};

/// The most bytes of a file.
const LARGEST: Limit = Limit::new("bytes of an experiment file", 1 << 20);
/// A file of experiments that cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum FileError {
    #[error(
        "cannot read the experiment file `{}`: {source}\n  help: an experiment file is TOML text; \
         `mirrorstats experiments show E1` prints one",
        path.display()
    )]
    Unreadable { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Faults(#[from] Faults),
    #[error(transparent)]
    TooMany(#[from] TooMany),
}

/// An experiment that is known now, and where it stands in its file.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub experiment: Experiment,
    /// Where its cubes stand, or its name where it says nothing of them.
    pub cubes: Place,
    /// Where each of its mirrors stands.
    pub mirrors: Vec<Place>,
    pub name: Place,
}

/// Reads the experiments of a file, and makes them known, in their order.
pub fn load(path: &Path) -> Result<Vec<Loaded>, FileError> {
    let text = input::text(path, LARGEST).map_err(|source| FileError::Unreadable { path: path.to_owned(), source })?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let source = Source { name: path.display().to_string(), text };
    let entries = file::read(source, Some(folder), &built_in_specs())?;
    entries
        .into_iter()
        .map(|Entry { known, name, cubes, mirrors }| {
            Ok(Loaded { experiment: Experiment::register(known)?, cubes, mirrors, name })
        })
        .collect()
}
