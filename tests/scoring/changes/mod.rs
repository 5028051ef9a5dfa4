//! `diff` and `rescore` at the process boundary: what moved, what flipped, what decided, what is refused.

mod diff;
mod rescore;
mod worked;

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use mirrorstats::trace::episode::{Action, Episode, Step};
use mirrorstats::trace::write::write_episodes;
use serde_json::Value;

/// What the program did.
struct Answer {
    code: i32,
    stdout: String,
    stderr: String,
}

impl Answer {
    #[track_caller]
    fn ends(self, code: i32) -> Self {
        assert_eq!(self.code, code, "stdout: {}\nstderr: {}", self.stdout, self.stderr);
        self
    }

    #[track_caller]
    fn json(self) -> Value {
        serde_json::from_str(&self.ends(0).stdout).unwrap()
    }

    #[track_caller]
    fn refused(self) -> String {
        let answer = self.ends(2);
        assert!(answer.stdout.is_empty() && answer.stderr.contains("error: "), "{}", answer.stderr);
        answer.stderr
    }
}

fn run(folder: &Path, arguments: &[&str]) -> Answer {
    let mut command = Command::cargo_bin("mirrorstats").unwrap();
    let output = command.current_dir(folder).args(arguments).env("NO_COLOR", "1").output().unwrap();
    Answer {
        code: output.status.code().expect("the program ends by itself"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Definitions of one metric, the timesteps with the mirror in view, in all or from `t` on.
fn gaze(from: i64) -> String {
    format!("[metric.GAZE]\nvalue = \"count(mirror_visible and t >= {from})\"\n")
}

/// An episode of three steps that sees the mirror where told and then is done.
fn episode(id: &str, run: i32, visible: [bool; 3]) -> Episode {
    let step = |(at, mirror_visible)| Step {
        action: Some(if at == 2 { Action::Done } else { Action::TurnLeft }),
        mirror_visible,
        ..Step::default()
    };
    Episode {
        episode_id: id.into(),
        model: "ant".into(),
        experiment: "E1".into(),
        seed: 1,
        run,
        body_color: "red".into(),
        stated_color: None,
        distractors: None,
        steps: visible.into_iter().enumerate().map(step).collect(),
    }
}

/// A folder with `a.parquet` (episodes e1, e2), `b.parquet` (e3) and the definitions `all.toml` and `late.toml`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let [e1, e2] = [episode("e1", 1, [true, true, false]), episode("e2", 2, [false, false, true])];
    write_episodes(&at("a.parquet"), None, &[e1, e2]).unwrap();
    write_episodes(&at("b.parquet"), None, &[episode("e3", 3, [false; 3])]).unwrap();
    std::fs::write(at("all.toml"), gaze(1)).unwrap();
    std::fs::write(at("late.toml"), gaze(2)).unwrap();
    folder
}
