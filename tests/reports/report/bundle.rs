//! A report's folder: its files, and files that stay untouched.

use std::fs;
use std::path::{Path, PathBuf};

use mirrorstats_report::bundle::{Bundle, BundleError, InputFile, Manifest, OutputFile, cells_csv, write};
use mirrorstats_report::layout::MetricTable;
use mirrorstats_report::style::Style;
use mirrorstats_score::cells::Cells;

use crate::assert_shown;
use crate::report::published;

struct Report {
    cells: Cells,
    tables: Vec<MetricTable>,
    manifest: Manifest,
}

/// Inputs as typed.
const INPUTS: [&str; 4] = ["b.parquet", "/data/of/someone/a.parquet", "../up/c.parquet", "./traces/d.parquet"];

fn report() -> Report {
    let cells = published::cells();
    let inputs = INPUTS.map(|path| InputFile::new(Path::new(path), "0".repeat(64), 5)).to_vec();
    let filter = Some("seed = 1".to_owned());
    let manifest = Manifest::new(&cells, &Style::load("paper").unwrap(), 1, filter, inputs);
    Report { cells, tables: published::tables("paper"), manifest }
}

fn write_to(out: &Path, report: &Report, others: &[OutputFile]) -> Result<Vec<PathBuf>, BundleError> {
    let Report { cells, tables, manifest } = report;
    let bundle = Bundle { cells, tables, lists: &[], episodes: b"PAR1", manifest, read: &[], others };
    write(out, &bundle).map(|written| written.files)
}

fn names(folder: &Path, files: &[PathBuf]) -> Vec<String> {
    files.iter().map(|file| file.strip_prefix(folder).unwrap().display().to_string()).collect()
}

#[test]
fn every_file_is_written_and_none_is_left_over() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("reports/latest");
    let figure = OutputFile { path: "figures/spider.svg".into(), bytes: b"<svg/>".to_vec() };
    let written = write_to(&out, &report(), &[figure]).unwrap();
    assert_shown!("the paper's tables, its cells and a figure", names(&out, &written).join("\n"));
    assert!(written.iter().all(|file| file.is_file()));
    assert_eq!(fs::read(out.join("episodes.parquet")).unwrap(), b"PAR1");
    assert_eq!(fs::read_dir(home.path().join("reports")).unwrap().count(), 1, "no temporary folder stays");
}

#[test]
fn a_second_report_replaces_its_files_and_no_others() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    fs::create_dir_all(out.join("tables")).unwrap();
    fs::write(out.join("tables/notes.txt"), "mine").unwrap();
    fs::write(out.join("cells.csv"), "old").unwrap();
    let written = write_to(&out, &report(), &[]).unwrap();
    let first: Vec<Vec<u8>> = written.iter().map(|file| fs::read(file).unwrap()).collect();
    let again = write_to(&out, &report(), &[]).unwrap();
    let second: Vec<Vec<u8>> = again.iter().map(|file| fs::read(file).unwrap()).collect();
    assert_eq!((written, first), (again, second));
    assert_eq!(fs::read_to_string(out.join("tables/notes.txt")).unwrap(), "mine");
    assert!(fs::read_to_string(out.join("cells.csv")).unwrap().starts_with("experiment,model,metric,n,sum,sum_sq,"));
}

#[test]
fn a_failed_write_changes_nothing() {
    let home = tempfile::tempdir().unwrap();
    let taken = home.path().join("taken");
    fs::write(&taken, "a file").unwrap();
    let error = write_to(&taken, &report(), &[]).unwrap_err();
    assert!(matches!(&error, BundleError::NotAFolder { path } if *path == taken), "{error}");
    let below = write_to(&taken.join("below"), &report(), &[]).unwrap_err();
    assert!(matches!(below, BundleError::Unwritable { .. }), "{below}");
    assert_eq!(fs::read_to_string(&taken).unwrap(), "a file");
}

#[test]
fn no_file_escapes_the_folder_or_overwrites_another() {
    let home = tempfile::tempdir().unwrap();
    for path in ["../outside", "/outside", "", "cells.csv", "./cells.csv"] {
        let other = OutputFile { path: path.into(), bytes: Vec::new() };
        let result = write_to(&home.path().join("out"), &report(), &[other]);
        assert!(matches!(result, Err(BundleError::BadPath { .. })), "{path}");
    }
    assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
}

#[test]
fn a_manifest_names_inputs_in_order_and_no_absolute_path() {
    let json = report().manifest.json();
    let inputs: Vec<String> = report().manifest.inputs.into_iter().map(|input| input.path).collect();
    assert_eq!(inputs, ["a.parquet", "b.parquet", "c.parquet", "traces/d.parquet"]);
    assert!(!json.contains("someone"));
    let back: Manifest = serde_json::from_str(&json).unwrap();
    assert_eq!(back, report().manifest);
    let json = json.replace(&report().manifest.style.sha256, "<hash>");
    assert_shown!(INPUTS.join("\n"), json.lines().take(20).collect::<Vec<_>>().join("\n"));
}

#[test]
fn cells_have_full_precision_and_nothing_for_undefined() {
    let csv = cells_csv(&report().cells);
    let lines = csv.lines().filter(|line| {
        line.starts_with("experiment,") || line.starts_with("E1,Gemini 2.5 Flash") || line.contains("E2,Ministral")
    });
    assert_shown!("cells.csv of fixtures/published, two models of it", lines.collect::<Vec<_>>().join("\n"));
}
