//! The parser of experiment files: every key is checked, and every error has its location.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::built_in_specs;
use super::schema::{AnyTable, ExperimentFile};
use super::spec::Spec;
use super::table::{self, Beside};
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::input;
use mirrorstats_toml_spec::{At, Fault, Faults, Shape, Source};

pub use super::table::Loaded;

const MOST_EXPERIMENTS: usize = 64;
const LARGEST: Limit = Limit::new("bytes of an experiment file", 1 << 20);

#[derive(Debug, thiserror::Error)]
pub enum FileError {
    #[error(
        "cannot read the experiment file `{}`: {source}\n  help: an experiment file is TOML text; \
         `mirrorstats experiments show E1` prints one",
        path.display()
    )]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Faults(#[from] Faults),
}

pub fn load(path: &Path) -> Result<Vec<Loaded>, FileError> {
    let text = input::text(path, LARGEST).map_err(|source| FileError::Unreadable { path: path.to_owned(), source })?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let source = Source { name: path.display().to_string(), text };
    Ok(read(source, Some(folder), &built_in_specs())?)
}

/// Parses the experiments of a text, which may use the scenes of `known` ones. Their own prompts are folders in
/// `folder`; a text without a folder is built in.
pub fn read(source: Source, folder: Option<&Path>, known: &[&Spec]) -> Result<Vec<Loaded>, Faults> {
    let help = "`mirrorstats trace schema experiments` says what each key may be";
    let with_help = |fault: Fault| if fault.help.is_some() { fault } else { fault.help(help) };
    entries(source, folder, known).map_err(|faults| Faults(faults.0.into_iter().map(with_help).collect()))
}

fn entries(source: Source, folder: Option<&Path>, known: &[&Spec]) -> Result<Vec<Loaded>, Faults> {
    let source = Arc::new(source);
    let (root, mut faults) = mirrorstats_toml_spec::parse(&source);
    if !faults.is_empty() {
        return Err(Faults(faults).in_order());
    }
    let root = At::root(&source, &root);
    Shape::of::<ExperimentFile<AnyTable>>().overlay().value(&root, "an experiment file", &mut faults);
    let tables: Vec<_> = root.get("experiment").iter().flat_map(At::entries).collect();
    if tables.is_empty() && faults.is_empty() {
        faults.push(root.fault("no experiment").help("add a table such as `[experiment.E6]`"));
    }
    if tables.len() > MOST_EXPERIMENTS {
        faults.push(root.fault(format!("a file holds at most {MOST_EXPERIMENTS} experiments, found {}", tables.len())));
        return Err(Faults(faults).in_order());
    }
    let mut entries: Vec<Loaded> = Vec::new();
    for (name, at) in tables {
        let own = entries.iter().map(|entry| &*entry.experiment);
        let before: Vec<&Spec> = known.iter().copied().chain(own).collect();
        let beside = Beside { folder, place: entries.len(), before: &before };
        let entry = table::read(name, &at, &beside, &mut faults);
        entries.extend(entry);
    }
    if faults.is_empty() { Ok(entries) } else { Err(Faults(faults).in_order()) }
}
