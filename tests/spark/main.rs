//! `--engine spark` at the process boundary: against a real cluster on loopback, and against a stand-in for
//! `spark-submit` where only what is said to it and made of its answers counts.
//!
//! The cluster needs Java and `scripts/get-spark.sh`; where they are missing its test says that it was skipped
//! (`MIRRORSTATS_REQUIRE_SPARK=1` makes that a failure).

mod cluster;
mod on_cluster;
mod parts;
mod stand_in;

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use mirrorstats::trace::episode::{Action, Episode, Extra, Step};
use mirrorstats::trace::write::{OptionalColumns, TraceMetadata, TraceWriter};

/// What the program did.
struct Answer {
    code: i32,
    stdout: String,
    stderr: String,
}

impl Answer {
    #[track_caller]
    fn done(self) -> String {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self.stdout
    }

    #[track_caller]
    fn refused(self) -> String {
        assert_eq!(self.code, 2, "stdout: {}\nstderr: {}", self.stdout, self.stderr);
        assert!(self.stdout.is_empty() && self.stderr.starts_with("error: "), "{}", self.stderr);
        self.stderr
    }
}

/// The program in a folder, without the Spark of whoever runs the tests.
fn program(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("mirrorstats").unwrap();
    command
        .current_dir(folder)
        .env_remove("SPARK_HOME")
        .env_remove("PYSPARK_PYTHON")
        .env_remove("PYSPARK_DRIVER_PYTHON");
    command
}

fn answer(command: &mut Command) -> Answer {
    let output = command.output().unwrap();
    Answer {
        code: output.status.code().expect("the program ends by itself"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/paper")
}

/// An episode with texts that are easy to get wrong, seen at t = 2, decided at t = 3.
fn episode(id: &str, experiment: &str, run: i32) -> Episode {
    let texts = [Some("I think it's\nme"), None, Some("naïve Straße, maybe\n"), Some("line1\rline2 \\ 'x'")];
    let step = |at: usize, action| Step {
        action,
        self_color: ["red", "unknown", "blue", "red"].get(at + usize::try_from(run).unwrap() % 2).map(|c| (*c).into()),
        selected_cube: (at > 0).then(|| "blue".into()),
        mirror_visible: at == 1,
        extra: Extra {
            reasoning: texts[at].map(str::to_owned),
            mirror_self_px: (at != 2).then_some(100 * run),
            pose_x: [Some(1.5), Some(f32::NAN), None, Some(-0.0)][at],
            ..Extra::default()
        },
    };
    let actions = [Some(Action::TurnLeft), None, Some(Action::Done), Some(Action::Done)];
    Episode {
        episode_id: id.into(),
        model: "it's `m` \\ é".into(),
        experiment: experiment.into(),
        seed: 1,
        run,
        body_color: "blue".into(),
        stated_color: (run == 1).then(|| "red".into()),
        steps: actions.into_iter().enumerate().map(|(at, action)| step(at, action)).collect(),
        ..Episode::default()
    }
}

/// Writes a trace; with `all`, it has every optional column, else those that the definitions of these tests read.
fn write(path: &Path, episodes: &[Episode], columns: OptionalColumns) {
    let mut writer = TraceWriter::create(path, &TraceMetadata { recording: None, columns }).unwrap();
    for episode in episodes {
        writer.write(episode).unwrap();
    }
    writer.finish().unwrap();
}
