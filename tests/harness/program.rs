//! The program as a process.

use std::path::Path;
use std::process::{Child, Command, Output};
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;

/// The path of the program.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_mirrorstats");

/// Variables in the environment of the tests that would change the program's behaviour.
const SETTINGS: [&str; 5] = ["COLUMNS", "NO_COLOR", "PYSPARK_DRIVER_PYTHON", "PYSPARK_PYTHON", "SPARK_HOME"];

/// The exit code and output of the program.
pub struct Answer {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Answer {
    #[track_caller]
    pub fn ends(self, code: i32) -> Self {
        assert_eq!(self.code, code, "stdout: {}\nstderr: {}", self.stdout, self.stderr);
        self
    }

    /// Standard output; the program must succeed.
    #[track_caller]
    pub fn done(self) -> String {
        self.ends(0).stdout
    }

    /// Standard output as JSON; the program must succeed.
    #[track_caller]
    pub fn json(self) -> Value {
        serde_json::from_str(&self.done()).unwrap()
    }

    /// Standard error of a refusal: exit code 2, no standard output, no panic.
    #[track_caller]
    pub fn refused(self) -> String {
        let Self { stdout, stderr, .. } = self.ends(2);
        assert!(stdout.is_empty(), "{stdout}");
        // Notes on omissions may come first.
        let is_error = stderr.starts_with("error: ") || stderr.starts_with("note: ") && stderr.contains("\nerror: ");
        assert!(is_error && stderr.ends_with('\n') && !stderr.contains("panicked"), "{stderr}");
        stderr
    }
}

impl From<Output> for Answer {
    fn from(output: Output) -> Self {
        Self {
            code: output.status.code().expect("the program ends by itself"),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

pub fn clean(mut command: Command, folder: &Path) -> Command {
    command.current_dir(folder);
    for name in SETTINGS {
        command.env_remove(name);
    }
    command
}

/// The program in a folder, without the caller's [`SETTINGS`].
pub fn program(folder: &Path) -> Command {
    clean(Command::new(PROGRAM), folder)
}

/// The program under a limit of the shell, such as `ulimit -v 524288`; a limit on file sizes simulates a full disk.
pub fn limited(folder: &Path, limit: &str) -> Command {
    let mut command = clean(Command::new("sh"), folder);
    command.args(["-c", &format!("{limit}; exec \"$0\" \"$@\""), PROGRAM]);
    command
}

/// The program with arguments separated by spaces, without quoting.
pub fn typed(folder: &Path, words: &str) -> Command {
    let mut command = program(folder);
    command.args(words.split_whitespace());
    command
}

pub fn answer(command: &mut Command) -> Answer {
    command.output().unwrap().into()
}

/// Runs the program in a folder.
pub fn run(folder: &Path, arguments: &[&str]) -> Answer {
    answer(program(folder).args(arguments))
}

/// Runs the program in a folder with this standard input.
pub fn run_with_input(folder: &Path, arguments: &[&str], input: impl Into<Vec<u8>>) -> Answer {
    let mut command = assert_cmd::Command::from_std(program(folder));
    command.args(arguments).write_stdin(input).output().unwrap().into()
}

/// Runs a command that must succeed.
#[track_caller]
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

/// Interrupts a process, as Ctrl-C does.
pub fn interrupt(child: &Child) {
    succeeds(Command::new("kill").args(["-INT", &child.id().to_string()]));
}

/// A process that is killed when this is dropped.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Polls until `look` returns something, for two minutes at most.
#[track_caller]
pub fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    for _ in 0..6000 {
        if let Some(found) = look() {
            return found;
        }
        sleep(Duration::from_millis(20));
    }
    panic!("waited in vain for {what}");
}
