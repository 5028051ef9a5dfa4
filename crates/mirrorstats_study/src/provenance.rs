//! Finds the traces of a report by its manifest.
//!
//! Rule: a file is the trace in the manifest if it has its hash, in whatever folder. All changed or missing traces are
//! reported together, and no report is made without them.

use std::ffi::OsStr;
use std::fs::{self, Metadata};
use std::io;
use std::path::{Component, Path, PathBuf};

use crate::error::kinds;
use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::{hash, input};
use mirrorstats_report::bundle::{self, MANIFEST, Manifest};
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::schema::SCHEMA_VERSION;
use serde::de::DeserializeOwned;

#[derive(Debug, thiserror::Error)]
pub enum ProvenanceError {
    #[error("{}: expected a report's folder with its {MANIFEST}, found {found}; name the folder that `mirrorstats report` wrote", path.display())]
    NoManifest { path: PathBuf, found: String },
    #[error("{}: expected the manifest of a report, found {found}; make the report again with `mirrorstats report`", path.display())]
    Malformed { path: PathBuf, found: String },
    #[error("{}: expected a file or folder that can be read, found {source}; check its permissions", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{} of {all} traces of the report have changed:\n{}\n{REMEDY}", faults.len(), lines(faults))]
    Traces { all: usize, faults: Vec<String> },
}

kinds! { Input: ProvenanceError; }

const REMEDY: &str = "  help: restore them, say where they are with --traces, or make a new report of what there is with `mirrorstats report`";

/// The most traces that a message lists, so that the remedy stays visible.
const LISTED: usize = 5;

fn lines(faults: &[String]) -> String {
    let mut lines: Vec<String> = faults.iter().take(LISTED).map(|fault| format!("  {fault}")).collect();
    if let Some(more) = faults.len().checked_sub(LISTED).filter(|more| *more > 0) {
        lines.push(format!("  and {more} more"));
    }
    lines.join("\n")
}

/// A trace takes about 200 bytes of a manifest.
const LARGEST: Limit = Limit::new("bytes of a manifest", 64 << 20);

/// Reads what a caller needs of a report's manifest, which must be a regular file.
pub(crate) fn read<T: DeserializeOwned>(folder: &Path) -> Result<T, ProvenanceError> {
    let path = folder.join(MANIFEST);
    let none = |found: String| ProvenanceError::NoManifest { path: folder.to_owned(), found };
    let about = fs::symlink_metadata(&path).map_err(|error| none(error.to_string()))?;
    if !about.is_file() {
        return Err(none(kind_of(&about).to_owned()));
    }
    let bytes = input::bytes(&path, LARGEST);
    let bytes = bytes.map_err(|source| ProvenanceError::Unreadable { path: path.clone(), source })?;
    serde_json::from_slice(&bytes).map_err(|error| ProvenanceError::Malformed { path, found: error.to_string() })
}

pub(crate) fn kind_of(about: &Metadata) -> &'static str {
    match about.file_type() {
        kind if kind.is_symlink() => "a symbolic link",
        kind if kind.is_dir() => "a folder",
        kind if kind.is_file() => "a file",
        _ => "neither a file nor a folder",
    }
}

pub(crate) fn manifest(report: &Path) -> Result<Manifest, ProvenanceError> {
    let manifest: Manifest = read(report)?;
    let malformed = |found: String| ProvenanceError::Malformed { path: report.join(MANIFEST), found };
    if manifest.schema_version > SCHEMA_VERSION {
        let found = format!("one over trace schema {}, newer than {SCHEMA_VERSION}", manifest.schema_version);
        return Err(malformed(found));
    }
    if manifest.inputs.is_empty() {
        return Err(malformed("one that names no trace".to_owned()));
    }
    match manifest.inputs.iter().find(|input| !is_plain(&input.path)) {
        None => Ok(manifest),
        Some(input) => Err(malformed(format!("the path `{}`, which leads out of its folder", input.path))),
    }
}

/// Returns true for a path inside its folder, `/` between its parts.
pub fn is_plain(path: &str) -> bool {
    let is_name = |part: &str| matches!(Path::new(part).components().collect::<Vec<_>>()[..], [Component::Normal(_)]);
    path.split('/').all(is_name)
}

/// The traces of a manifest, by their names in it, searched in `places` in order.
pub fn traces(manifest: &Manifest, places: &[PathBuf]) -> Result<Vec<Input>, ProvenanceError> {
    let (mut found, mut faults) = (Vec::new(), Vec::new());
    for wanted in &manifest.inputs {
        match find(wanted, places) {
            Ok(path) => found.push(Input { name: wanted.path.clone(), path }),
            Err(fault) => faults.push(fault),
        }
    }
    let all = manifest.inputs.len();
    if faults.is_empty() { Ok(found) } else { Err(ProvenanceError::Traces { all, faults }) }
}

/// The file of this hash in the first place that has it. The error says what the first file of this name was.
fn find(wanted: &bundle::InputFile, places: &[PathBuf]) -> Result<PathBuf, String> {
    let bundle::InputFile { path: name, sha256: expected, .. } = wanted;
    let mut fault = None;
    for path in places.iter().flat_map(|place| candidates(wanted, place)) {
        let at = path.display();
        let found = match input::open(&path).and_then(hash::of_reader) {
            Ok(hash) if hash == *expected => return Ok(path),
            Ok(hash) => format!("{name}: changed; expected sha256 {expected}, found {hash} in {at}"),
            Err(error) => format!("{name}: cannot read `{at}`: {error}; expected sha256 {expected}"),
        };
        fault.get_or_insert(found);
    }
    Err(fault.unwrap_or_else(|| format!("{name}: missing; expected sha256 {expected}")))
}

fn candidates(wanted: &bundle::InputFile, place: &Path) -> Vec<PathBuf> {
    let path = Path::new(&wanted.path);
    if place.is_file() {
        let names = [place, path].map(|path| path.file_name().map(OsStr::to_string_lossy));
        return if names[0] == names[1] { vec![place.to_owned()] } else { Vec::new() };
    }
    let mut candidates = shown_as(place, path);
    for bare in path.file_name().map(|name| shown_as(place, Path::new(name))).unwrap_or_default() {
        if !candidates.contains(&bare) {
            candidates.push(bare);
        }
    }
    candidates.retain(|path| path.is_file());
    candidates
}

fn shown_as(folder: &Path, path: &Path) -> Vec<PathBuf> {
    path.components().fold(vec![folder.to_owned()], |folders, part| {
        let part = part.as_os_str().to_string_lossy();
        if !part.contains(char::REPLACEMENT_CHARACTER) {
            return folders.iter().map(|folder| folder.join(&*part)).collect();
        }
        let is_shown = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy() == part);
        let entries = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten();
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(is_shown).collect()
    })
}

/// The places where a report's traces are searched: the given ones, else the current folder, the report's folder and
/// its parents.
pub(crate) fn places(report: &Path, given: &[PathBuf]) -> Vec<PathBuf> {
    if !given.is_empty() {
        return given.to_vec();
    }
    let here = PathBuf::from(".");
    let report = fs::canonicalize(report).unwrap_or_else(|_| report.to_owned());
    std::iter::once(here).chain(report.ancestors().map(Path::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::{candidates, is_plain, places};
    use mirrorstats_report::bundle;
    use std::path::{Path, PathBuf};

    #[test]
    fn paths_outside_the_folder_are_not_plain() {
        for (path, plain) in
            [("a.parquet", true), ("runs/a.parquet", true), ("/a.parquet", false), ("../a.parquet", false), ("", false)]
        {
            assert_eq!(is_plain(path), plain, "{path}");
        }
    }

    #[test]
    fn a_given_folder_is_the_only_one_searched() {
        assert_eq!(places(Path::new("r"), &[PathBuf::from("there")]), [PathBuf::from("there")]);
    }

    #[test]
    fn a_trace_may_lie_under_its_path_or_its_name() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("runs")).unwrap();
        let wanted = bundle::InputFile { path: "runs/a.parquet".into(), sha256: String::new(), bytes: 0 };
        let [deep, bare] = ["runs/a.parquet", "a.parquet"].map(|name| folder.path().join(name));
        std::fs::write(&bare, "").unwrap();
        assert_eq!(candidates(&wanted, folder.path()), std::slice::from_ref(&bare));
        assert_eq!(candidates(&wanted, &bare), std::slice::from_ref(&bare));
        std::fs::write(&deep, "").unwrap();
        assert_eq!(candidates(&wanted, folder.path()), [deep, bare]);
    }
}
