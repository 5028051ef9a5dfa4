//! `mirrorstats publish` and `mirrorstats verify`: a study as a folder, and the check of it.

mod action;
mod bundle;
mod changes;
mod opened;

use std::fs;
use std::path::Path;

use mirrorstats_exact::hash;
use serde_json::Value;
use tempfile::TempDir;

use crate::harness::files::fixture;
use crate::harness::program::run;

/// A small study with frames, and a person's own definitions, style and description.
pub fn published(frames: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("runs")).unwrap();
    for name in ["E1-guesser.parquet", "E1-guesser.mcap", "E3-random.parquet"] {
        fs::copy(fixture("recorded").join(name), at.join("runs").join(name)).unwrap();
    }
    fs::write(at.join("mine.toml"), "include = [\"paper\"]\n[metric.STEPS]\ntitle = \"Steps\"\nvalue = \"length()\"\n")
        .unwrap();
    fs::write(at.join("about.toml"), ABOUT).unwrap();
    let words =
        ["publish", "runs", "-o", "out", "--definitions", "mine.toml", "--about", "about.toml", "--frames", frames];
    run(at, &words).done();
    folder
}

const ABOUT: &str = "title = \"Two agents: \\\"mirrors\\\"\"\nauthors = [\"Family, Given\", \"A group\"]\n\
    license = \"CC-BY-4.0\"\nlimitations = \"Four episodes.\"\nderived_from = [\"https://example.org/data\"]\n";

/// The paths that `verify` names, and its exit code.
pub fn named(folder: &Path) -> (i32, Vec<String>) {
    let answer = run(folder, &["verify", "out", "--json", "--threads", "1"]);
    let found: Value = serde_json::from_str(&answer.stdout).unwrap_or_else(|_| panic!("{}", answer.stderr));
    let paths = found["differences"].as_array().unwrap().iter().map(|one| one["path"].as_str().unwrap().to_owned());
    (answer.code, paths.collect())
}

/// Writes the manifest anew, so that each hash is that of the present file.
pub fn rewrite_manifest(bundle: &Path) {
    let path = bundle.join("manifest.json");
    let mut manifest: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    manifest["outputs"]
        .as_array_mut()
        .unwrap()
        .retain(|output| bundle.join(output["path"].as_str().unwrap()).is_file());
    for output in manifest["outputs"].as_array_mut().unwrap() {
        let bytes = fs::read(bundle.join(output["path"].as_str().unwrap())).unwrap();
        output["bytes"] = bytes.len().into();
        output["sha256"] = hash::of_bytes(&bytes).into();
    }
    manifest["sha256"] = "".into();
    let text = |manifest: &Value| serde_json::to_string_pretty(manifest).unwrap() + "\n";
    manifest["sha256"] = hash::of_bytes(text(&manifest).as_bytes()).into();
    fs::write(path, text(&manifest)).unwrap();
}
