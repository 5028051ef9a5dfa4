//! Required programs. If one is missing, the test fails and names the script that fetches it.

use std::env;
use std::path::PathBuf;
use std::process::{Command, Stdio};
#[cfg(feature = "sim")]
use std::sync::OnceLock;

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// The browser on this machine.
pub fn browser() -> PathBuf {
    let folders: Vec<PathBuf> = env::var_os("PATH").map(|path| env::split_paths(&path).collect()).unwrap_or_default();
    let mut candidates = BROWSERS.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name)));
    let found = candidates.find(|program| program.is_file());
    found.unwrap_or_else(|| panic!("none of {BROWSERS:?} is on PATH: scripts/get-browser.sh installs one"))
}

/// The accessibility engine from `scripts/get-axe.sh`, beside cargo's output.
pub fn axe() -> PathBuf {
    let engine = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).with_file_name("axe-core").join("axe.min.js");
    assert!(engine.is_file(), "no axe-core in {}: scripts/get-axe.sh fetches it", engine.display());
    engine
}

/// The folder of pyspark from `scripts/get-spark.sh`, beside cargo's output.
pub fn spark() -> PathBuf {
    let packages = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).with_file_name("python-spark");
    let java = Command::new("java").arg("-version").stderr(Stdio::null()).status();
    assert!(java.is_ok_and(|status| status.success()), "no Java on PATH: scripts/get-spark.sh installs it");
    let is_there = packages.join("pyspark/bin/spark-class").is_file();
    assert!(is_there, "no pyspark in {}: scripts/get-spark.sh fetches it", packages.display());
    packages
}

/// The folder of DuckDB from `scripts/get-duckdb.sh`, beside cargo's output.
pub fn duckdb() -> PathBuf {
    let packages = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).with_file_name("python");
    let is_there = packages.join("duckdb").is_dir();
    assert!(is_there, "no DuckDB in {}: scripts/get-duckdb.sh fetches it", packages.display());
    packages
}

/// The folder of Parquet writers from `scripts/get-writers.sh`, beside cargo's output.
pub fn writers() -> PathBuf {
    let packages = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).with_file_name("python-writers");
    let is_there = packages.join("fastparquet").is_dir();
    assert!(is_there, "no Parquet writers in {}: scripts/get-writers.sh fetches them", packages.display());
    packages
}

/// The folder of `numpy` from `scripts/get-numpy.sh`, beside cargo's output.
pub fn numpy() -> PathBuf {
    let packages = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).with_file_name("python-numpy");
    let is_there = packages.join("numpy").is_dir();
    assert!(is_there, "no NumPy in {}: scripts/get-numpy.sh fetches it", packages.display());
    packages
}

/// The folder of programs with importable logs from `scripts/get-harnesses.sh`, beside cargo's output.
pub fn harnesses() -> PathBuf {
    let packages = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).with_file_name("python-harnesses");
    let is_there = packages.join("inspect_ai").is_dir();
    assert!(is_there, "no harnesses in {}: scripts/get-harnesses.sh fetches them", packages.display());
    packages
}

/// A folder of packages from `scripts/get-datasets.sh`, beside cargo's output.
pub fn packages(name: &str) -> PathBuf {
    let packages = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).with_file_name(name);
    assert!(packages.is_dir(), "no {}: scripts/get-datasets.sh fetches it", packages.display());
    packages
}

/// The program that compiles LaTeX to PDF.
pub fn pdftex() -> &'static str {
    let found = Command::new("pdflatex").arg("--version").stdout(Stdio::null()).status();
    assert!(found.is_ok_and(|status| status.success()), "no pdflatex on PATH: scripts/get-tex.sh installs it");
    "pdflatex"
}

/// An interpreter of Python.
pub fn python() -> &'static str {
    let found = Command::new("python3").arg("--version").stdout(Stdio::null()).status();
    assert!(found.is_ok_and(|status| status.success()), "no python3 on PATH: the scripts of the tests need it too");
    "python3"
}

/// Checks that pictures can be drawn without a display.
#[cfg(feature = "sim")]
pub fn drawing() {
    use mirrorstats_sim::{camera::Camera, config::WorldConfig};
    static FAULT: OnceLock<Option<String>> = OnceLock::new();
    if let Some(fault) = FAULT.get_or_init(|| Camera::new(&WorldConfig::default()).err().map(|error| error.to_string()))
    {
        panic!("{fault}: scripts/get-egl.sh installs what draws");
    }
}
