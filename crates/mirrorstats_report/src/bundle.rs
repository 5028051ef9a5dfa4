//! The folder of a report. A new report replaces the old one completely or leaves it unchanged.
//!
//! The files of the old report are the outputs in its manifest. They are replaced, or removed if the new report lacks
//! them; all other files in the folder stay.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::layout::{MetricTable, key_field};
use crate::style::Style;
use mirrorstats_exact::hash;
use mirrorstats_exact::number::full_precision;
use mirrorstats_exact::replace::{self, Content, FolderFiles, FolderHoldsInput, TargetIsInput};
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_score::cells::{Cell, Cells};
use mirrorstats_tables::{ListTable, Table};

/// The name of the manifest, which is written last.
pub const MANIFEST: &str = "manifest.json";

#[derive(Clone, Copy, Debug)]
pub struct Bundle<'a> {
    /// For `cells.csv`.
    pub cells: &'a Cells,
    /// For `tables/<name>.{tex,md,csv}`.
    pub tables: &'a [MetricTable],
    /// More tables in the same formats, after `tables`.
    pub lists: &'a [ListTable],
    /// The bytes of `episodes.parquet`.
    pub episodes: &'a [u8],
    /// For `manifest.json`; its outputs are added when they are written.
    pub manifest: &'a Manifest,
    /// The files that are read; no output may replace them.
    pub read: &'a [PathBuf],
    /// Figures and other files, by their path inside the folder.
    pub others: &'a [OutputFile],
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputFile {
    /// Its path inside the folder.
    pub path: PathBuf,
    pub bytes: Vec<u8>,
}

/// The origin of a report: all that is needed to make it again, and nothing that differs between two runs.
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
    /// The inputs, ordered by path, then hash.
    pub inputs: Vec<InputFile>,
    /// The files beside this manifest, ordered by path. The copy inside `report.html` has none, because it cannot
    /// contain its own hash.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outputs: Vec<Output>,
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
#[schemars(rename = "Input")]
pub struct InputFile {
    /// The path as given if that is relative, else the file's name alone.
    pub path: String,
    /// SHA-256 of its content.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
}

/// One file of the report.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Output {
    /// The path inside the folder, `/` between its parts.
    pub path: String,
    /// SHA-256 of its content.
    pub sha256: String,
    /// Its size.
    pub bytes: u64,
}

#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    #[error("cannot write the report to {}: it is not a folder; give another one with --out", path.display())]
    NotAFolder { path: PathBuf },
    #[error("cannot write the report: `{}` is not a path of its own inside the folder", path.display())]
    BadPath { path: PathBuf },
    #[error("cannot write the report: {0}, or the report another --out")]
    InputFile(#[from] TargetIsInput),
    #[error(transparent)]
    Folder(#[from] FolderHoldsInput),
    #[error("cannot write the report to {}; is the folder writable?", path.display())]
    Unwritable { path: PathBuf, source: io::Error },
}

impl Manifest {
    /// The manifest of a report made by this version.
    pub fn new(
        cells: &Cells,
        style: &Style,
        schema_version: u32,
        filter: Option<String>,
        mut inputs: Vec<InputFile>,
    ) -> Self {
        inputs.sort();
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            schema_version,
            style: StyleOrigin { name: style.name.clone(), sha256: style.hash.clone() },
            by: cells.by.clone(),
            metrics: cells.metrics.clone(),
            filter,
            inputs,
            outputs: Vec::new(),
            definitions: cells.catalog.clone(),
        }
    }

    fn with_outputs(&self, files: &[OutputFile]) -> Self {
        let mut outputs: Vec<Output> = files.iter().map(Output::new).collect();
        outputs.sort();
        Self { outputs, ..self.clone() }
    }

    pub fn json(&self) -> String {
        let json = serde_json::to_string_pretty(self).expect("a manifest holds only strings, integers and lists");
        json + "\n"
    }
}

impl InputFile {
    /// An input in the form allowed in a manifest: no absolute path, no `..`, `/` between folders.
    pub fn new(path: &Path, sha256: String, bytes: u64) -> Self {
        let is_plain = |part: &Component| matches!(part, Component::Normal(_) | Component::CurDir);
        let is_inside = path.components().all(|part| is_plain(&part));
        let shown = if is_inside { path } else { Path::new(path.file_name().unwrap_or(path.as_os_str())) };
        let parts = shown.components().filter(|part| matches!(part, Component::Normal(_)));
        let parts: Vec<_> = parts.map(|part| part.as_os_str().to_string_lossy()).collect();
        Self { path: parts.join("/"), sha256, bytes }
    }
}

impl Output {
    fn new(file: &OutputFile) -> Self {
        Self {
            path: InputFile::new(&file.path, String::new(), 0).path,
            sha256: hash::of_bytes(&file.bytes),
            bytes: file.bytes.len() as u64,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    pub files: Vec<PathBuf>,
    pub manifest: Manifest,
}

pub fn write(out: &Path, bundle: &Bundle) -> Result<Written, BundleError> {
    let mut files = files(bundle);
    let manifest = bundle.manifest.with_outputs(&files);
    files.push(OutputFile { path: MANIFEST.into(), bytes: manifest.json().into_bytes() });
    files.sort_by(|a, b| a.path.cmp(&b.path));
    check_paths(&files)?;
    if out.exists() && !out.is_dir() {
        return Err(BundleError::NotAFolder { path: out.to_owned() });
    }
    check_old(out, bundle.read)?;
    let new: Vec<_> = files.iter().map(|file| (file.path.as_path(), Content::Bytes(&file.bytes))).collect();
    check_inputs(out, &new.iter().map(|(path, _)| path).collect::<Vec<_>>(), bundle.read)?;
    replace::replace_folder(out, &FolderFiles { new: &new, index: Some(Path::new(MANIFEST)), old: &old_files })
        .map_err(|error| BundleError::Unwritable { path: error.path, source: error.source })?;
    Ok(Written { files: files.into_iter().map(|file| out.join(file.path)).collect(), manifest })
}

/// Checks that no file of the report in `out` is among the files that are read: a new report would replace it.
pub fn check_old(out: &Path, read: &[PathBuf]) -> Result<(), BundleError> {
    check_inputs(out, &old_files(out), read)
}

fn check_inputs<P: AsRef<Path>>(out: &Path, targets: &[P], read: &[PathBuf]) -> Result<(), BundleError> {
    let mut targets = targets.iter().map(|path| out.join(path));
    Ok(targets.try_for_each(|target| replace::check_target(&target, read, "one that is read"))?)
}

fn files(bundle: &Bundle) -> Vec<OutputFile> {
    let file = |path: &str, bytes: &[u8]| OutputFile { path: PathBuf::from(path), bytes: bytes.to_vec() };
    let mut files =
        vec![file("cells.csv", cells_csv(bundle.cells).as_bytes()), file("episodes.parquet", bundle.episodes)];
    for ListTable { name, printed, records } in bundle.tables.iter().map(MetricTable::list).chain(bundle.lists.to_vec())
    {
        for (ending, text) in [("tex", printed.latex()), ("md", printed.markdown()), ("csv", records.csv())] {
            files.push(file(&format!("tables/{name}.{ending}"), text.as_bytes()));
        }
    }
    files.extend_from_slice(bundle.others);
    files
}

/// The text of `cells.csv`: the key columns, then `metric,n,sum,sum_sq,mean,se,ci_low,ci_high` in full precision.
///
/// The standard error has the form that the definition asks for. The interval is Wilson's for a rate, Student's for a
/// quantity, at 95 %. Undefined or withheld values are empty. The key columns are those that the cells are grouped by.
pub fn cells_csv(cells: &Cells) -> String {
    const TAIL: [&str; 8] = ["metric", "n", "sum", "sum_sq", "mean", "se", "ci_low", "ci_high"];
    let header = cells.by.iter().map(String::as_str).chain(TAIL);
    Table::of_texts(header).with(cells.all().map(cell_record)).csv()
}

fn cell_record(cell: Cell) -> Vec<String> {
    cell.key.iter().map(key_field).chain([cell.name.to_owned()]).chain(cell_numbers(&cell)).collect()
}

/// The numbers of a cell from `n` on.
pub(crate) fn cell_numbers(Cell { metric, moments, interval, .. }: &Cell) -> [String; 7] {
    let of = |value: Option<f64>| value.map(full_precision).unwrap_or_default();
    let [sum, sum_sq] = metric.sums(moments).map(|sum| sum.to_string());
    let [low, high] = [interval.map(|i| i.low), interval.map(|i| i.high)];
    let [low, high] = [low, high].map(|bound| of(bound.map(|bound| metric.in_unit(bound))));
    [moments.n.to_string(), sum, sum_sq, of(metric.mean(moments)), of(metric.standard_error(moments)), low, high]
}

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

/// The files of the report in a folder, including the manifest, by path inside it; empty without a manifest of a
/// report.
fn old_files(folder: &Path) -> Vec<PathBuf> {
    let text = fs::read(folder.join(MANIFEST)).unwrap_or_default();
    let Ok(manifest) = serde_json::from_slice::<Manifest>(&text) else { return Vec::new() };
    manifest.outputs.into_iter().map(|output| output.path.into()).chain([MANIFEST.into()]).collect()
}
