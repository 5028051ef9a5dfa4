//! `mirrorstats record --agent vlm` as a process: a small world, short episodes, and a server on loopback.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use mirrorstats_vlm::journal::Entry;
use tempfile::TempDir;

use super::bench::KEY;
use super::server::{Request, Server, decision};
use crate::harness::files::write_small_world;
use crate::harness::program::program;
use crate::harness::{need, traces};

/// A folder to record in.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        need::drawing();
        let folder = tempfile::tempdir().unwrap();
        write_small_world(folder.path(), "");
        Self(folder)
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// `record` of a model into `runs`, with additional words.
    pub fn record(&self, server: &Server, model: &str, words: &str) -> Command {
        let mut command = program(self.path());
        command.env("MIRRORSTATS_API_KEY", KEY).args(["record", "--agent", "vlm", "--model", model]);
        if !words.contains("--base-url") {
            command.args(["--base-url", &server.address]);
        }
        command.args(["--config", "small.toml", "--no-log", "--experiment", "E1"]).args(words.split_whitespace());
        command
    }

    /// The journal entries by file, without a last line that was cut off.
    pub fn journals(&self) -> BTreeMap<PathBuf, Vec<Entry>> {
        let Ok(files) = fs::read_dir(self.path().join("runs/journal")) else { return BTreeMap::new() };
        let read = |path: PathBuf| {
            let text = fs::read(&path).unwrap();
            let lines = text.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n"));
            (path, lines.map(|line| serde_json::from_slice(line).unwrap()).collect())
        };
        files.map(|file| read(file.unwrap().path())).collect()
    }
}

/// The reply of a model that turns left and is done at step `last`. It counts in its summaries, which come back with
/// the next request. `mark` distinguishes this reply from all others.
pub fn counting(request: &Request, last: u32, mark: usize) -> String {
    let before = request.body.split_once("counted to ").and_then(|(_, rest)| rest.split_once(' '));
    let step = before.map_or(1, |(count, _)| count.parse::<u32>().unwrap() + 1);
    let action = if step < last { "a" } else { "done" };
    decision(action).replace("went on", &format!("counted to {step} in answer {mark}"))
}

/// The column `reply_status` of the folder's trace of E1.
pub fn rows(folder: &Folder, runs: &str) -> Vec<String> {
    let statuses = traces::texts(&folder.path().join(runs).join("E1-own.parquet"), "reply_status");
    statuses.into_iter().map(Option::unwrap).collect()
}
