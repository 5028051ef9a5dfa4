//! A small log to cut and damage, and facts about it from its own index.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::LazyLock;

use mirrorstats_log::recover::{Recovered, recover_from};
use serde_json::Value;
use tempfile::TempDir;

use crate::harness::files::write_small_world;
use crate::harness::program::{program, run, succeeds, typed};

/// A log of three episodes and its trace.
pub struct Recording {
    pub log: Vec<u8>,
    pub trace: Vec<u8>,
    /// The start and end of each episode's chunk.
    pub chunks: Vec<(usize, usize)>,
}

/// Changes to the small world for these tests.
pub const SHORT: &str = "episode.steps = 40\n";

/// The recording for these tests, made once.
pub static RECORDING: LazyLock<Recording> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    write_small_world(folder.path(), SHORT);
    let words = "record --config small.toml --out runs --agent random --experiment E1 --seeds 1 --runs 3 --no-frames";
    succeeds(&mut typed(folder.path(), words));
    let [log, trace] =
        ["mcap", "parquet"].map(|ending| fs::read(folder.path().join(format!("runs/E1-random.{ending}"))).unwrap());
    let index = mcap::Summary::read(&log).unwrap().unwrap().chunk_indexes;
    let place = |offset: u64| usize::try_from(offset).unwrap();
    let mut chunks: Vec<_> = index
        .iter()
        .map(|chunk| (place(chunk.chunk_start_offset), place(chunk.chunk_start_offset + chunk.chunk_length)))
        .collect();
    chunks.sort_unstable();
    assert_eq!(chunks.len(), 3, "a chunk an episode");
    Recording { log, trace, chunks }
});

impl Recording {
    /// The episodes that have ended before this byte.
    pub fn ended(&self, at: usize) -> Vec<String> {
        let ended = self.chunks.iter().filter(|(_, end)| *end <= at).count();
        (1..=ended).map(|run| format!("E1/random/s1/r{run}")).collect()
    }

    /// The starts of the file's records, and the end of the last one.
    pub fn boundaries(&self) -> Vec<usize> {
        let mut boundaries = vec![mcap::MAGIC.len()];
        let mut at = mcap::MAGIC.len();
        while at + mcap::MAGIC.len() < self.log.len() {
            let length = u64::from_le_bytes(self.log[at + 1..at + 9].try_into().unwrap());
            at += 9 + usize::try_from(length).unwrap();
            boundaries.push(at);
        }
        boundaries
    }

    /// The start of the first record with this opcode.
    pub fn first(&self, opcode: u8) -> usize {
        self.boundaries().into_iter().find(|at| self.log[*at] == opcode).unwrap()
    }
}

/// What can be recovered from these bytes.
pub fn recovered(bytes: &[u8]) -> Recovered {
    recover_from(Path::new("log.mcap"), Cursor::new(bytes)).unwrap()
}

pub fn ids(recovered: &Recovered) -> Vec<String> {
    recovered.episodes.iter().map(|episode| episode.episode_id.clone()).collect()
}

/// A folder where the program recovers logs.
pub struct Desk(TempDir);

impl Desk {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn trace(&self) -> PathBuf {
        self.0.path().join("trace.parquet")
    }

    /// Runs `recover` on these bytes, without an older trace.
    pub fn recover(&self, bytes: &[u8], more: &[&str]) -> Output {
        drop(fs::remove_file(self.trace()));
        fs::write(self.0.path().join("cut.mcap"), bytes).unwrap();
        let mut command = program(self.0.path());
        command.args(["trace", "recover", "cut.mcap", "-o", "trace.parquet"]).args(more);
        command.output().unwrap()
    }

    /// Checks the trace with `validate` and returns its episode ids.
    pub fn validated(&self) -> Vec<String> {
        run(self.0.path(), &["trace", "validate", "trace.parquet"]).ends(0);
        let text = run(self.0.path(), &["score", "trace.parquet"]).done();
        text.lines().skip(1).map(|line| line.split(',').next().unwrap().to_owned()).collect()
    }
}

pub fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}
