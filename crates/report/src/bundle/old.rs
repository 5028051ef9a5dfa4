//! Files of an older report in the same folder.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::figures::FigureName;

/// The name of the manifest, which is written last.
pub const MANIFEST: &str = "manifest.json";

/// The needed part of a manifest; other versions may have more fields.
#[derive(Deserialize)]
struct Listed {
    outputs: Option<Vec<ListedOutput>>,
    /// Only distinguishes a report's manifest from other files of that name.
    #[serde(rename = "schema_version")]
    _schema_version: u32,
}

#[derive(Deserialize)]
struct ListedOutput {
    path: PathBuf,
}

/// The files of the report in a folder, including the manifest, by path inside it; empty without a manifest of a
/// report.
pub(super) fn files(folder: &Path) -> Vec<PathBuf> {
    let manifest = fs::read(folder.join(MANIFEST)).ok();
    let Some(Ok(manifest)) = manifest.map(|text| serde_json::from_slice::<Listed>(&text)) else { return Vec::new() };
    let mut files = match manifest.outputs {
        Some(outputs) => outputs.into_iter().map(|output| output.path).collect(),
        None => by_name(folder),
    };
    files.push(MANIFEST.into());
    files
}

/// The files that an older report may have, by name: the files with fixed names, every figure in every format, and
/// every table that exists in all three formats.
fn by_name(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = ["cells.csv", "episodes.parquet", "report.html"].map(PathBuf::from).into();
    for figure in FigureName::ALL {
        files.extend(["svg", "png", "pdf"].map(|ending| format!("figures/{figure}.{ending}").into()));
    }
    for name in table_names(folder) {
        files.extend(["tex", "md", "csv"].map(|ending| format!("tables/{name}.{ending}").into()));
    }
    files.retain(|file| folder.join(file).is_file());
    files
}

fn table_names(folder: &Path) -> Vec<String> {
    let tables = folder.join("tables");
    let entries = fs::read_dir(&tables).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().to_str()?.strip_suffix(".tex").map(str::to_owned));
    names.filter(|name| ["md", "csv"].iter().all(|ending| tables.join(format!("{name}.{ending}")).is_file())).collect()
}
