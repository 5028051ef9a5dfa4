//! Checks the files of a report or of a bundle against its manifest.
//!
//! Rule: it never looks outside the folder, whatever the manifest says, and follows no links.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs::{self, Metadata};
use std::io;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::provenance::{ProvenanceError, is_plain, kind_of, read};
use mirrorstats_exact::escape::visible;
use mirrorstats_exact::format::counted;
use mirrorstats_exact::{hash, input};
use mirrorstats_report::bundle::{MANIFEST, Output};

/// The needed part of a manifest; other versions may have more fields.
#[derive(Deserialize)]
struct Listed {
    #[serde(default)]
    outputs: Vec<Output>,
    /// Only distinguishes a report's manifest from other files of that name.
    #[serde(rename = "schema_version")]
    _schema_version: u32,
}

/// The result of verifying a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Verification {
    /// The number of files in the manifest.
    pub files: usize,
    /// The number of episodes whose numbers were computed again; null for a report, which has no traces.
    pub episodes: Option<usize>,
    /// Files that are not as the manifest says, by path.
    pub differences: Vec<Difference>,
    /// Statements about what was not checked.
    pub notes: Vec<String>,
}

/// A file that is not as the manifest says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Difference {
    /// The path inside the folder, `/` between its parts.
    pub path: String,
    /// The kind of problem.
    pub kind: Kind,
    /// The place in the file; null if only its hash is known.
    pub cell: Option<String>,
    /// The expected value.
    pub expected: String,
    /// The value found.
    pub found: String,
}

/// The kind of a file's problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// It has another content, or is no file.
    Changed,
    /// The manifest lists it, and it is not there.
    Missing,
    /// It is there, and the manifest does not list it.
    Unexpected,
}

pub fn verify(folder: &Path) -> Result<Verification, ProvenanceError> {
    let listed = listed(folder)?;
    let mut there = entries(folder).map_err(|(path, source)| ProvenanceError::Unreadable { path, source })?;
    let mut differences = Vec::new();
    for (path, output) in &listed {
        differences.extend(difference(folder, path, output, there.remove(path))?);
    }
    there.remove(MANIFEST);
    let unexpected = |(path, about)| Difference::new(path, Kind::Unexpected, "no such file", kind_of(&about));
    differences.extend(there.into_iter().map(unexpected));
    differences.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(Verification { files: listed.len(), differences, ..Verification::default() })
}

fn listed(folder: &Path) -> Result<BTreeMap<String, Output>, ProvenanceError> {
    let malformed = |found: String| ProvenanceError::Malformed { path: folder.join(MANIFEST), found };
    let manifest: Listed = read(folder)?;
    if manifest.outputs.is_empty() {
        return Err(malformed("one that lists no outputs".to_owned()));
    }
    let mut listed = BTreeMap::new();
    for output in manifest.outputs {
        if let Some(found) = fault(&output) {
            return Err(malformed(found));
        }
        if let Some(twice) = listed.insert(output.path.clone(), output) {
            return Err(malformed(format!("`{}` twice among its outputs", visible(&twice.path))));
        }
    }
    Ok(listed)
}

fn fault(output: &Output) -> Option<String> {
    let shown = visible(&output.path);
    if !is_plain(&output.path) {
        return Some(format!("the output `{shown}`, which is not a path inside its folder"));
    }
    if output.path == MANIFEST {
        return Some(format!("`{MANIFEST}` among its outputs"));
    }
    let is_hash = output.sha256.len() == 64 && output.sha256.bytes().all(|digit| digit.is_ascii_hexdigit());
    (!is_hash).then(|| format!("the output `{shown}` with `{}` in place of a SHA-256", visible(&output.sha256)))
}

/// Everything in a folder except folders, by its path inside, `/` between the parts. Follows no links. The error names
/// what cannot be read.
pub fn entries(folder: &Path) -> Result<BTreeMap<String, Metadata>, (PathBuf, io::Error)> {
    let mut found = BTreeMap::new();
    let unreadable = |path: &Path| {
        let path = path.to_owned();
        move |error| (path, error)
    };
    for entry in fs::read_dir(folder).map_err(unreadable(folder))? {
        let entry = entry.map_err(unreadable(folder))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let about = fs::symlink_metadata(entry.path()).map_err(unreadable(&entry.path()))?;
        if about.is_dir() {
            found.extend(entries(&entry.path())?.into_iter().map(|(path, about)| (format!("{name}/{path}"), about)));
        } else {
            found.insert(name, about);
        }
    }
    Ok(found)
}

fn difference(
    folder: &Path,
    path: &str,
    output: &Output,
    there: Option<Metadata>,
) -> Result<Option<Difference>, ProvenanceError> {
    let expected = format!("{} bytes with the SHA-256 {}", output.bytes, output.sha256);
    let differs = |kind, found: &str| Ok(Some(Difference::new(path, kind, expected.as_str(), found)));
    let Some(about) = there else { return differs(Kind::Missing, "no such file") };
    if !about.is_file() {
        return differs(Kind::Changed, kind_of(&about));
    }
    let at = folder.join(path);
    let found = input::open(&at)
        .and_then(hash::of_reader)
        .map_err(|source| ProvenanceError::Unreadable { path: at, source })?;
    if found == output.sha256.to_ascii_lowercase() && about.len() == output.bytes {
        return Ok(None);
    }
    differs(Kind::Changed, &format!("{} bytes with the SHA-256 {found}", about.len()))
}

impl Difference {
    /// The difference of a whole file.
    pub fn new(path: impl Into<String>, kind: Kind, expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { path: path.into(), kind, cell: None, expected: expected.into(), found: found.into() }
    }
}

impl Verification {
    pub fn holds(&self) -> bool {
        self.differences.is_empty()
    }

    fn count(&self, kind: Kind) -> usize {
        let paths = self.differences.iter().filter(|difference| difference.kind == kind).map(|it| &it.path);
        paths.collect::<BTreeSet<_>>().len()
    }
}

impl fmt::Display for Verification {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Difference { path, kind, cell, expected, found } in &self.differences {
            let path = visible(path);
            if let Some(cell) = cell {
                writeln!(f, "{path}: {}: expected {}, published {}", visible(cell), visible(expected), visible(found))?;
                continue;
            }
            match kind {
                Kind::Changed => writeln!(f, "{path}: changed; expected {expected}, found {found}")?,
                Kind::Missing => writeln!(f, "{path}: missing; expected {expected}")?,
                Kind::Unexpected => writeln!(f, "{path}: unexpected; the manifest does not list it")?,
            }
        }
        let files = self.files;
        if self.holds() {
            let verb = if files == 1 { "is" } else { "are" };
            write!(f, "{} {verb} as the manifest says", counted(files as u64, "file"))?;
            return match self.episodes {
                Some(count) => write!(f, "; all numbers of {} are equal", counted(count as u64, "episode")),
                None => Ok(()),
            };
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        let [changed, missing, unexpected] =
            [Kind::Changed, Kind::Missing, Kind::Unexpected].map(|kind| self.count(kind));
        write!(
            f,
            "{} in the manifest: {changed} changed, {missing} missing, {unexpected} unexpected",
            counted(files as u64, "file")
        )
    }
}
