//! Small recordings to compare, quick enough to make many.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use tempfile::TempDir;

use crate::harness::files::{Contents, contents, write_small_world};
use crate::harness::program::{program, succeeds};

/// A folder with a configuration and a place for recordings.
pub struct Bench {
    pub folder: TempDir,
}

impl Bench {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        write_small_world(folder.path(), "");
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `record` into the folder `out`, with the small world and additional words, without frames.
    pub fn record(&self, out: &str, words: &str) -> Command {
        let mut command = self.record_with_frames(out, words);
        command.arg("--no-frames");
        command
    }

    pub fn record_with_frames(&self, out: &str, words: &str) -> Command {
        let mut command = program(self.folder.path());
        command.args(["record", "--config", "small.toml", "--out", out]);
        command.args(words.split_whitespace());
        command
    }

    /// Records successfully and returns the files.
    pub fn recorded(&self, out: &str, words: &str) -> Contents {
        succeeds(&mut self.record(out, words));
        self.files(out)
    }

    /// Every file of a folder and its subfolders, including hidden ones.
    pub fn files(&self, out: &str) -> Contents {
        contents(&self.path(out))
    }

    /// The number of episodes that are still parts.
    pub fn parts(&self, out: &str) -> usize {
        let Ok(entries) = fs::read_dir(self.path(out).join(".parts")) else { return 0 };
        entries
            .filter(|entry| entry.as_ref().unwrap().path().extension().is_some_and(|ending| ending == "parquet"))
            .count()
    }
}
