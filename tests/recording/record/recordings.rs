//! Recordings to compare, small enough to make many of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// What these tests change in the world: less to count.
pub const SMALL: &str = "eye.width = 64\neye.height_px = 48\neye.samples = 0\n";

/// A folder with a configuration and a place for recordings.
pub struct Bench {
    pub folder: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("small.toml"), SMALL).unwrap();
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `record` into the folder `out`, with the small world and these words; no frames.
    pub fn record(&self, out: &str, words: &str) -> Command {
        let mut command = self.record_with_frames(out, words);
        command.arg("--no-frames");
        command
    }

    pub fn record_with_frames(&self, out: &str, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mirrorstats"));
        command.current_dir(self.folder.path()).args(["record", "--config", "small.toml", "--out", out]);
        command.args(words.split_whitespace());
        command
    }

    /// The files of a recording that ends well.
    pub fn recorded(&self, out: &str, words: &str) -> BTreeMap<String, Vec<u8>> {
        succeeds(&mut self.record(out, words));
        self.files(out)
    }

    /// Every file of a folder, hidden ones and those in folders too.
    pub fn files(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let mut found = BTreeMap::new();
        gather(&self.path(out), "", &mut found);
        found
    }

    /// How many episodes wait as parts.
    pub fn parts(&self, out: &str) -> usize {
        let Ok(entries) = fs::read_dir(self.path(out).join(".parts")) else { return 0 };
        entries
            .filter(|entry| entry.as_ref().unwrap().path().extension().is_some_and(|ending| ending == "parquet"))
            .count()
    }
}

fn gather(folder: &Path, prefix: &str, found: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_str().unwrap());
        if path.is_dir() {
            gather(&path, &format!("{name}/"), found);
        } else {
            found.insert(name, fs::read(&path).unwrap());
        }
    }
}

/// Runs a command that must end well.
pub fn succeeds(command: &mut Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", stderr(&output));
    output
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// That two recordings are the same, told by name rather than by megabytes.
pub fn assert_same(found: &BTreeMap<String, Vec<u8>>, expected: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    for (name, bytes) in expected {
        assert!(found[name] == *bytes, "{name} has other bytes");
    }
}
