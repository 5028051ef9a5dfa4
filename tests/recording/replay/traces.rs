//! Small traces to replay, and altered copies of them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::LazyLock;

use mirrorstats_trace::episodes::episode::Episode;
use mirrorstats_trace::write::OptionalColumns;
use mirrorstats_trace::write::merge;
use serde_json::Value;
use tempfile::TempDir;

use crate::harness::files::write_small_world;
use crate::harness::program::{program, succeeds, typed};
use crate::harness::traces::{episodes, recording};

/// Recordings of E1, E3, E4 and `decoy` with a small eye; two pixels count as evidence. Made once per process: cargo-nextest
/// runs each test in a process of its own.
pub static RECORDED: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("replayed-{}", std::process::id()));
    drop(fs::remove_dir_all(&folder));
    fs::create_dir_all(&folder).unwrap();
    write_small_world(&folder, "episode.steps = 40\nevidence.mirror_self_px = 2\n");
    let words = "record --config small.toml --out runs --agent random --experiment E1,E3,E4,decoy --seeds 1 --runs 3 \
                 --no-frames --no-log";
    succeeds(&mut typed(&folder, words));
    folder.join("runs")
});

pub fn recorded(experiment: &str) -> PathBuf {
    RECORDED.join(format!("{experiment}-random.parquet"))
}

/// A copy of a recording with changed episodes and footer.
pub fn copy(experiment: &str, change: impl FnOnce(&mut Vec<Episode>, &mut Value)) -> (TempDir, PathBuf) {
    let original = recorded(experiment);
    let (mut episodes, mut recording) = (episodes(&original), recording(&original));
    change(&mut episodes, &mut recording);
    let columns = OptionalColumns::recorded(&recording);
    let rows: Vec<_> = episodes.iter().map(|episode| merge::rows(episode, &columns).unwrap()).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("copy.parquet");
    let recording = Some(recording).filter(|recording| !recording.is_null());
    merge::write(&path, recording.as_ref(), &rows).unwrap();
    (folder, path)
}

pub fn replay(path: &Path, words: &[&str]) -> Output {
    program(path.parent().unwrap()).args(["world", "replay"]).arg(path).args(words).output().unwrap()
}
