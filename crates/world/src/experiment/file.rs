//! The text of a file of experiments: every key accounted for, every fault with its place.

use std::path::Path;
use std::sync::Arc;

use super::spec::Spec;
use super::table::{self, Beside, Entry};
use toml_spec::{Fault, Faults, Place, Source};
use toml_spec::{Keys, parse_toml};

/// The most experiments of a file.
const MOST_EXPERIMENTS: usize = 64;

/// Reads the experiments of a text, which may have the scenes of those that are `known`. Prompts of its own are folders in
/// `folder`; a text without a folder is built in.
pub fn read(source: Source, folder: Option<&Path>, known: &[&Spec]) -> Result<Vec<Entry>, Faults> {
    entries(source, folder, known).map_err(|faults| Faults(faults.0.into_iter().map(with_help).collect()))
}

/// A fault that says no remedy of its own names the list of what may be written.
fn with_help(fault: Fault) -> Fault {
    if fault.help.is_some() {
        return fault;
    }
    fault.help("`mirrorstats trace schema experiments` says what each key may be")
}

fn entries(source: Source, folder: Option<&Path>, known: &[&Spec]) -> Result<Vec<Entry>, Faults> {
    let source = Arc::new(source);
    let (table, mut faults) = parse_toml(&source);
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
            let before: Vec<&Spec> =
                known.iter().copied().chain(entries.iter().map(|entry| &entry.known.spec)).collect();
            table::read(&name, &place, keys, &Beside { folder, before: &before }, &mut faults)
        };
        entries.extend(entry);
    }
    if faults.is_empty() { Ok(entries) } else { Err(Faults(faults).in_order()) }
}
