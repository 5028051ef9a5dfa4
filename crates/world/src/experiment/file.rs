//! The parser of experiment files: every key is checked, and every error has its location.

use std::path::Path;
use std::sync::Arc;

use super::schema::{AnyTable, ExperimentFile};
use super::spec::Spec;
use super::table::{self, Beside, Entry};
use toml_spec::{At, Fault, Faults, Shape, Source};

const MOST_EXPERIMENTS: usize = 64;

/// Parses the experiments of a text, which may use the scenes of `known` ones. Their own prompts are folders in
/// `folder`; a text without a folder is built in.
pub fn read(source: Source, folder: Option<&Path>, known: &[&Spec]) -> Result<Vec<Entry>, Faults> {
    entries(source, folder, known).map_err(|faults| Faults(faults.0.into_iter().map(with_help).collect()))
}

fn with_help(fault: Fault) -> Fault {
    if fault.help.is_some() {
        return fault;
    }
    fault.help("`mirrorstats trace schema experiments` says what each key may be")
}

fn entries(source: Source, folder: Option<&Path>, known: &[&Spec]) -> Result<Vec<Entry>, Faults> {
    let source = Arc::new(source);
    let (root, mut faults) = toml_spec::parse(&source);
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
    let mut entries: Vec<Entry> = Vec::new();
    for (name, at) in tables {
        let entry = {
            let before: Vec<&Spec> =
                known.iter().copied().chain(entries.iter().map(|entry| &entry.known.spec)).collect();
            table::read(name, &at, &Beside { folder, before: &before }, &mut faults)
        };
        entries.extend(entry);
    }
    if faults.is_empty() { Ok(entries) } else { Err(Faults(faults).in_order()) }
}
