//! The program at the process boundary: exit codes, what is said where, and that nothing is left half done.

mod colors;
mod extended;
mod filters;
mod generated;
#[path = "../../examples/generate/generation/mod.rs"]
mod generation;
mod help;
mod hostile;
mod options;
#[cfg(target_os = "linux")]
mod outputs;
mod refusals;
#[cfg(unix)]
mod reports;
mod scores;
mod widths;

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use mirrorstats::trace::episode::{Action, Episode, Step};
use mirrorstats::trace::write::write_episodes;

/// What the program did.
struct Answer {
    code: i32,
    stdout: String,
    stderr: String,
}

impl Answer {
    /// Standard output of a run that went well.
    #[track_caller]
    fn done(self) -> String {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self.stdout
    }

    /// Standard error of a run that was refused: exit code 2, nothing on standard output, never a panic.
    #[track_caller]
    fn refused(self) -> String {
        assert_eq!(self.code, 2, "stdout: {}\nstderr: {}", self.stdout, self.stderr);
        assert!(self.stdout.is_empty(), "{}", self.stdout);
        // Notes on what was left out may come before.
        let is_error = self.stderr.lines().any(|line| line.starts_with("error: "));
        assert!(is_error && self.stderr.ends_with('\n'), "{}", self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        self.stderr
    }
}

/// Runs the program in a folder.
fn run(folder: &Path, arguments: &[&str]) -> Answer {
    run_with_input(folder, arguments, "")
}

/// Runs the program in a folder with something on standard input.
fn run_with_input(folder: &Path, arguments: &[&str], input: &str) -> Answer {
    let mut command = Command::cargo_bin("mirrorstats").unwrap();
    command.current_dir(folder).args(arguments).write_stdin(input).env_remove("COLUMNS").env_remove("NO_COLOR");
    let output = command.output().unwrap();
    Answer {
        code: output.status.code().expect("the program ends by itself"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// The fixtures of the repository.
fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures")
}

/// An episode that sees the mirror at t = 2 and decides at t = 3.
fn episode(model: &str, experiment: &str, run: i32, choice: &str) -> Episode {
    let step = |action, mirror_visible| Step {
        action: Some(action),
        self_color: Some("blue".into()),
        selected_cube: Some(choice.into()),
        mirror_visible,
        ..Step::default()
    };
    Episode {
        episode_id: format!("{experiment}-{model}-{run}"),
        model: model.into(),
        experiment: experiment.into(),
        seed: 1,
        run,
        body_color: if run % 2 == 0 { "red" } else { "blue" }.into(),
        steps: vec![step(Action::TurnLeft, false), step(Action::MoveForward, true), step(Action::Done, false)],
        ..Episode::default()
    }
}

/// A folder with `a.parquet` and `b.parquet`: two models, two experiments, four runs each.
fn two_files() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, experiment) in [("a", "E1"), ("b", "E5")] {
        let episodes: Vec<Episode> = (0..8)
            .map(|at| episode(["ant", "bee"][at % 2], experiment, i32::try_from(at / 2).unwrap(), "red"))
            .collect();
        write_episodes(&folder.path().join(format!("{name}.parquet")), None, &episodes).unwrap();
    }
    folder
}

/// Every file in a folder and below it, by path, with its bytes.
fn contents(folder: &Path) -> std::collections::BTreeMap<String, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(std::fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
        } else {
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            found.insert(name, std::fs::read(&path).unwrap());
        }
    }
    found
}
