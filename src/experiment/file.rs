//! Files of experiments: TOML in, every key accounted for, every fault with its place.

use std::io::{self};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml::de::DeTable;

use super::spec::Spec;
use super::table::{self, Beside, Entry};
use super::{Experiment, TooMany, built_in};
use crate::base::budget::Limit;
use crate::base::input;
use crate::metric::fault::{Fault, Faults, Place, Source};
use crate::metric::keys::Keys;

/// The most bytes of a file.
const LARGEST: Limit = Limit::new("bytes of an experiment file", 1 << 20);
/// The most experiments of a file.
const MOST_EXPERIMENTS: usize = 64;

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
    /// The experiment.
    pub experiment: Experiment,
    /// Where its cubes stand, or its name where it says nothing of them.
    pub cubes: Place,
    /// Where its name stands.
    pub name: Place,
}

/// Reads the experiments of a file, and makes them known, in their order.
///
/// # Errors
/// When the file cannot be read, or all of its faults.
pub fn load(path: &Path) -> Result<Vec<Loaded>, FileError> {
    let text = text_of(path).map_err(|source| FileError::Unreadable { path: path.to_owned(), source })?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let source = Source { name: path.display().to_string(), text };
    let entries = read(source, Some(folder))?;
    entries
        .into_iter()
        .map(|Entry { known, name, cubes }| Ok(Loaded { experiment: Experiment::register(known)?, cubes, name }))
        .collect()
}

fn text_of(path: &Path) -> io::Result<String> {
    input::text(path, LARGEST)
}

/// Reads the experiments of a text; prompts of its own are folders in `folder`. A text without a folder is built in.
///
/// # Errors
/// All of its faults.
pub fn read(source: Source, folder: Option<&Path>) -> Result<Vec<Entry>, Faults> {
    entries(source, folder).map_err(|faults| Faults(faults.0.into_iter().map(with_help).collect()))
}

/// A fault that says no remedy of its own names the list of what may be written.
fn with_help(fault: Fault) -> Fault {
    if fault.help.is_some() {
        return fault;
    }
    fault.help("`mirrorstats schema experiments` says what each key may be")
}

fn entries(source: Source, folder: Option<&Path>) -> Result<Vec<Entry>, Faults> {
    let source = Arc::new(source);
    let (table, errors) = DeTable::parse_recoverable(&source.text);
    let mut faults: Vec<Fault> = errors
        .into_iter()
        .map(|error| {
            let place = Place { source: source.clone(), span: error.span().unwrap_or(0..0) };
            Fault::new(place, format!("not TOML: {}", error.message()))
        })
        .collect();
    if !faults.is_empty() {
        return Err(Faults(faults).in_order());
    }
    let mut root = Keys::new(&source, table.get_ref(), "an experiment file");
    let tables = root.tables("experiment", &mut faults);
    root.refuse_the_rest(&mut faults);
    let whole = Place { source: source.clone(), span: 0..0 };
    if tables.is_empty() && faults.is_empty() {
        faults.push(Fault::new(whole.clone(), "no experiment").help("add a table such as `[experiment.E6]`"));
    }
    if tables.len() > MOST_EXPERIMENTS {
        let message = format!("a file holds at most {MOST_EXPERIMENTS} experiments, found {}", tables.len());
        faults.push(Fault::new(whole, message));
        return Err(Faults(faults).in_order());
    }
    let mut entries: Vec<Entry> = Vec::new();
    for (name, place, keys) in tables {
        let entry = {
            let mut before: Vec<&Spec> = entries.iter().map(|entry| &entry.known.spec).collect();
            if folder.is_some() {
                before.splice(0..0, built_in::specs().map(|spec| spec as &Spec));
            }
            table::read(&name, &place, keys, &Beside { folder, before: &before }, &mut faults)
        };
        entries.extend(entry);
    }
    if faults.is_empty() { Ok(entries) } else { Err(Faults(faults).in_order()) }
}
