//! Small traces to replay, and altered copies of them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use mirrorstats::trace::episode::Episode;
use mirrorstats::trace::inputs::Input;
use mirrorstats::trace::merge;
use mirrorstats::trace::open::TraceSet;
use mirrorstats::trace::schema::RECORDING_KEY;
use mirrorstats::trace::write::OptionalColumns;
use serde_json::Value;
use tempfile::TempDir;

/// Recordings of E1, E3 and E4 through a small eye that takes two pixels for evidence; made once.
pub static RECORDED: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("replayed");
    drop(fs::remove_dir_all(&folder));
    fs::create_dir_all(&folder).unwrap();
    let small =
        "eye.width = 64\neye.height_px = 48\neye.samples = 0\nepisode.steps = 40\nevidence.mirror_self_px = 2\n";
    fs::write(folder.join("small.toml"), small).unwrap();
    let words = "record --config small.toml --out runs --agent random --experiment E1,E3,E4 --seeds 1 --runs 3 \
                 --no-frames --no-log";
    succeeds(program(&folder).args(words.split_whitespace()));
    folder.join("runs")
});

pub fn recorded(experiment: &str) -> PathBuf {
    RECORDED.join(format!("{experiment}-random.parquet"))
}

pub fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mirrorstats"));
    command.current_dir(folder);
    command
}

pub fn succeeds(command: &mut Command) -> Output {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}{}", stdout(&output), stderr(&output));
    output
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Whether pictures cannot be drawn here, told by the program's words; said on standard error.
pub fn cannot_draw(output: &Output) -> bool {
    let is_so = stderr(output).contains("libegl1");
    if is_so {
        assert!(std::env::var_os("MIRRORSTATS_REQUIRE_EGL").is_none(), "{}", stderr(output));
        eprintln!("skipped: nothing to draw with; libegl1 and libgl1-mesa-dri bring it");
    }
    is_so
}

pub fn episodes(path: &Path) -> Vec<Episode> {
    merge::read(path).unwrap().iter().map(|rows| rows.episode().unwrap()).collect()
}

pub fn recording(path: &Path) -> Value {
    let input = Input { name: path.display().to_string(), path: path.to_owned() };
    let set = TraceSet::open(&[input]).unwrap();
    serde_json::from_str(set.files()[0].metadata_value(RECORDING_KEY).unwrap()).unwrap()
}

/// A copy of a recording with other episodes and another footer.
pub fn copy(experiment: &str, change: impl FnOnce(&mut Vec<Episode>, &mut Value)) -> (TempDir, PathBuf) {
    let original = recorded(experiment);
    let (mut episodes, mut recording) = (episodes(&original), recording(&original));
    change(&mut episodes, &mut recording);
    let rows: Vec<_> = episodes.iter().map(|episode| merge::rows(episode, &OptionalColumns::all()).unwrap()).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("copy.parquet");
    let recording = Some(recording).filter(|recording| !recording.is_null());
    merge::write(&path, recording.as_ref(), &rows).unwrap();
    (folder, path)
}

pub fn replay(path: &Path, words: &[&str]) -> Output {
    program(path.parent().unwrap()).arg("replay").arg(path).args(words).output().unwrap()
}
