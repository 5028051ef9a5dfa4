//! The folder of a report: every file in it whole, or none of them changed.
//!
//! All files are written into a temporary folder first and moved into place together. In a folder that
//! exists, only the files that a report has are replaced; whatever else is there stays.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

use crate::base::number::full_precision;
use crate::base::temporary;
use crate::cells::cell::{Cells, Group};
use crate::metric::catalog::{Catalog, Metric};
use crate::report::style::Style;
use crate::report::table::Table;
use crate::report::tables::{csv, latex, markdown};
use crate::report::value::interval;

/// What goes into the folder.
#[derive(Clone, Copy, Debug)]
pub struct Bundle<'a> {
    /// For `cells.csv`.
    pub cells: &'a Cells,
    /// For `tables/<name>.{tex,md,csv}`.
    pub tables: &'a [Table],
    /// The bytes of `episodes.parquet`.
    pub episodes: &'a [u8],
    /// For `manifest.json`.
    pub manifest: &'a Manifest,
    /// Figures and whatever else, by their path inside the folder.
    pub others: &'a [OutputFile],
}

/// A file of the folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputFile {
    /// Its path inside the folder.
    pub path: PathBuf,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// Where a report comes from: enough to make it again, and nothing that differs between two makings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Manifest {
    /// The version of mirrorstats.
    pub version: String,
    /// The version of the trace schema.
    pub schema_version: u32,
    /// The style of the tables.
    pub style: StyleOrigin,
    /// The columns that the cells are grouped by.
    pub by: Vec<String>,
    /// The metrics that were computed, in the order of the definitions.
    pub metrics: Vec<String>,
    /// The filter over episodes, as typed.
    #[serde(rename = "where")]
    pub filter: Option<String>,
    /// What was read, ordered by path, then hash.
    pub inputs: Vec<Input>,
    /// The definitions that gave the values.
    pub definitions: Catalog,
}

/// The style of a report.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct StyleOrigin {
    /// Its name; never a path.
    pub name: String,
    /// SHA-256 of the style file.
    pub sha256: String,
}

/// One file that was read.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Input {
    /// The path as given if that is relative, else the file's name alone.
    pub path: String,
    /// SHA-256 of its content.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
}

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// Something else has the folder's name.
    #[error("cannot write the report to {}: it is not a folder; give another one with --out", path.display())]
    NotAFolder {
        /// Where.
        path: PathBuf,
    },
    /// A file would land outside the folder, or twice at one place.
    #[error("cannot write the report: `{}` is not a path of its own inside the folder", path.display())]
    BadPath {
        /// The path.
        path: PathBuf,
    },
    /// The file system refuses.
    #[error("cannot write the report to {}; is the folder writable?", path.display())]
    Unwritable {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Manifest {
    /// The manifest of a report made now, by this version.
    pub fn new(cells: &Cells, style: &Style, schema_version: u32, filter: Option<String>, inputs: Vec<Input>) -> Self {
        let mut inputs = inputs;
        inputs.sort();
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            schema_version,
            style: StyleOrigin { name: style.name.clone(), sha256: style.hash.clone() },
            by: cells.by.clone(),
            metrics: cells.metrics.clone(),
            filter,
            inputs,
            definitions: cells.catalog.clone(),
        }
    }

    /// The text of `manifest.json`.
    #[expect(clippy::missing_panics_doc, reason = "strings, integers and lists always have a JSON text")]
    pub fn json(&self) -> String {
        let json = serde_json::to_string_pretty(self).expect("a manifest holds only strings, integers and lists");
        json + "\n"
    }
}

impl Input {
    /// An input named as a manifest may name it: no absolute path, no way up, `/` between folders.
    pub fn new(path: &Path, sha256: String, bytes: u64) -> Self {
        let is_plain = |part: &Component| matches!(part, Component::Normal(_) | Component::CurDir);
        let is_inside = path.components().all(|part| is_plain(&part));
        let shown = if is_inside { path } else { Path::new(path.file_name().unwrap_or(path.as_os_str())) };
        let parts = shown.components().filter(|part| matches!(part, Component::Normal(_)));
        let parts: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
        Self { path: parts.join("/"), sha256, bytes }
    }
}

/// Writes the report into the folder `out`; returns the files written, in order.
///
/// # Errors
/// Where `out` is no folder or cannot be written. The folder is then as it was, unless moving a finished file into
/// place failed half-way.
pub fn write(out: &Path, bundle: &Bundle) -> Result<Vec<PathBuf>, BundleError> {
    let files = files(bundle);
    check_paths(&files)?;
    if out.exists() && !out.is_dir() {
        return Err(BundleError::NotAFolder { path: out.to_owned() });
    }
    let stage = stage_for(out)?;
    // The temporary folder is private; the one in it gets the permissions that any new folder has.
    let staged = stage.path().join("report");
    for file in &files {
        write_file(&staged.join(&file.path), &file.bytes)?;
    }
    put_in_place(&staged, out, &files)?;
    Ok(files.into_iter().map(|file| out.join(file.path)).collect())
}

/// A temporary folder on the file system of `out`: inside it if it exists, which may be a mounted volume, else beside.
fn stage_for(out: &Path) -> Result<TempDir, BundleError> {
    let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let place = if out.is_dir() { out } else { parent };
    let unwritable =
        |source| BundleError::Unwritable { path: place.to_owned(), source: temporary::without_name(source) };
    fs::create_dir_all(place).map_err(unwritable)?;
    tempfile::Builder::new().prefix(".mirrorstats-").tempdir_in(place).map_err(unwritable)
}

/// Every file of the folder, ordered by path.
fn files(bundle: &Bundle) -> Vec<OutputFile> {
    let file = |path: &str, bytes: &[u8]| OutputFile { path: PathBuf::from(path), bytes: bytes.to_vec() };
    let mut files = vec![
        file("cells.csv", cells_csv(bundle.cells).as_bytes()),
        file("episodes.parquet", bundle.episodes),
        file("manifest.json", bundle.manifest.json().as_bytes()),
    ];
    for table in bundle.tables {
        for (ending, text) in
            [("tex", latex::render(table)), ("md", markdown::render(table)), ("csv", csv::render(table))]
        {
            files.push(file(&format!("tables/{}.{ending}", table.name), text.as_bytes()));
        }
    }
    files.extend_from_slice(bundle.others);
    files.sort_by(|a, b| a.path.cmp(&b.path));
    files
}

/// The text of `cells.csv`: the key columns, then `metric,n,sum,sum_sq,mean,se,ci_low,ci_high` in full precision.
///
/// The standard error is the one that the definition asks for; the interval is Wilson's for a rate, Student's for a
/// quantity, at 95 %. What is undefined is empty. The header's keys are those that the cells are grouped by.
pub fn cells_csv(cells: &Cells) -> String {
    const TAIL: [&str; 8] = ["metric", "n", "sum", "sum_sq", "mean", "se", "ci_low", "ci_high"];
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    csv::write(&mut writer, cells.by.iter().cloned().chain(TAIL.map(str::to_owned)));
    for group in &cells.groups {
        for (at, name) in cells.metrics.iter().enumerate() {
            if let Some(metric) = cells.catalog.metric.get(name) {
                csv::write(&mut writer, cell_record(group, at, name, metric));
            }
        }
    }
    csv::finish(writer)
}

fn cell_record(group: &Group, at: usize, name: &str, metric: &Metric) -> Vec<String> {
    let moments = &group.moments[at];
    let interval = interval(moments, metric);
    let of = |value: Option<f64>| value.map(full_precision).unwrap_or_default();
    let mut record: Vec<String> = group.key.iter().map(csv::key_field).collect();
    record.extend([name.to_owned(), moments.n.to_string(), moments.sum.to_string(), moments.sum_sq.to_string()]);
    record.extend([of(moments.mean()), of(moments.se(metric.se))]);
    record.extend([of(interval.map(|i| i.low)), of(interval.map(|i| i.high))]);
    record
}

/// That every file is inside the folder, and no two are one.
fn check_paths(files: &[OutputFile]) -> Result<(), BundleError> {
    let mut seen = BTreeSet::new();
    for OutputFile { path, .. } in files {
        let is_inside = path.components().all(|part| matches!(part, Component::Normal(_)));
        if !is_inside || path.as_os_str().is_empty() || !seen.insert(path) {
            return Err(BundleError::BadPath { path: path.clone() });
        }
    }
    Ok(())
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), BundleError> {
    let unwritable = |source| BundleError::Unwritable { path: path.to_owned(), source };
    make_folder_of(path)?;
    fs::write(path, bytes).map_err(unwritable)
}

fn put_in_place(staged: &Path, out: &Path, files: &[OutputFile]) -> Result<(), BundleError> {
    let unwritable = |path: &Path| {
        let path = path.to_owned();
        move |source| BundleError::Unwritable { path, source }
    };
    if !out.exists() {
        return fs::rename(staged, out).map_err(unwritable(out));
    }
    for file in files {
        make_folder_of(&out.join(&file.path))?;
    }
    for file in files {
        let target = out.join(&file.path);
        fs::rename(staged.join(&file.path), &target).map_err(unwritable(&target))?;
    }
    Ok(())
}

fn make_folder_of(path: &Path) -> Result<(), BundleError> {
    let Some(folder) = path.parent() else { return Ok(()) };
    fs::create_dir_all(folder).map_err(|source| BundleError::Unwritable { path: folder.to_owned(), source })
}
