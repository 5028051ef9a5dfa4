//! Recordings of programs in a small world with short episodes.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

use mirrorstats_exact::hash::of_bytes;
use serde_json::Value;
use tempfile::TempDir;

use crate::harness::files::write_small_world;
use crate::harness::program::{program, stderr};
use crate::harness::{need, traces};

/// A reply that moves forward, quoted for the shell.
pub const FORWARD: &str = r#"{"view-description":"a wall","reasoning":"go on","action":"w","summary":"went on","selected_cube":"none","identification":"I am red"}"#;

/// Replies that end with `done` at the third observation.
pub fn three_steps() -> String {
    format!("if [ $n -lt 3 ]; then echo '{FORWARD}'; else echo '{}'; fi", done())
}

/// The part of a task that only this experiment's episode of seed 1 has: a hash of seed and run.
pub fn seed_of(experiment: u64, run: u64) -> String {
    let seed = (experiment << 56) ^ (1 << 24) ^ run ^ 0x6d69_7272_6f72;
    let hash = of_bytes(&[b"mirrorstats agent seed ", &seed.to_le_bytes()[..]].concat());
    format!("\"seed\":{},", u64::from_str_radix(&hash[..16], 16).unwrap())
}

/// A reply that selects the red cube.
pub fn done() -> String {
    FORWARD.replace("\"w\"", "\"done\"").replace("\"none\"", "\"red\"")
}

/// A folder with a configuration, programs, and a place for recordings.
pub struct Bench {
    pub folder: TempDir,
}

impl Bench {
    /// A folder with episodes as short as their rooms allow. Programs get frames, which must be drawn.
    pub fn new() -> Self {
        need::drawing();
        let folder = tempfile::tempdir().unwrap();
        write_small_world(folder.path(), "episode.steps = 20\n");
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a program that appends every line to `heard.jsonl` and runs `answer` at each observation.
    pub fn program(&self, answer: &str) {
        let script = format!(
            "while read -r line; do\n  printf '%s\\n' \"$line\" >> heard.jsonl\n  case \"$line\" in\n    \
             *'\"kind\":\"observation\"'*)\n      n=$((n + 1))\n      {answer} ;;\n  esac\ndone\n"
        );
        fs::write(self.path("program.sh"), script).unwrap();
    }

    /// `record` with `sh program.sh`, one episode of E1 unless `words` say otherwise.
    pub fn record(&self, words: &[&str]) -> Command {
        self.record_of("exec:sh program.sh", words)
    }

    pub fn record_of(&self, agent: &str, words: &[&str]) -> Command {
        let mut command = program(self.folder.path());
        command.args(["record", "--config", "small.toml"]);
        if !words.contains(&"--out") {
            command.args(["--out", "runs"]);
        }
        command.args(["--seeds", "1", "--no-log", "--json", "--agent", agent]).args(words);
        if !words.contains(&"--experiment") {
            command.args(["--experiment", "E1"]);
        }
        if !words.contains(&"--runs") {
            command.args(["--runs", "1"]);
        }
        command
    }

    /// The lines that programs received, in order.
    pub fn heard(&self) -> Vec<Value> {
        self.lines("heard.jsonl")
    }

    /// The list of lost episodes.
    pub fn lost(&self) -> Vec<Value> {
        self.lines("runs/lost.jsonl")
    }

    fn lines(&self, name: &str) -> Vec<Value> {
        let text = fs::read_to_string(self.path(name)).unwrap_or_default();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// A text column of a trace; null as `None`.
    pub fn texts(&self, name: &str, column: &str) -> Vec<Option<String>> {
        traces::texts(&self.path(name), column)
    }

    /// The files of a recording other than traces and programs' standard error.
    pub fn leftovers(&self) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.path("runs")) else { return Vec::new() };
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.filter(|name| !name.ends_with(".parquet") && name != "stderr").collect();
        names.sort();
        names
    }
}

/// The exit code, the answer of `--json`, and standard error.
pub fn outcome(output: &Output) -> (Option<i32>, Value, String) {
    let answer = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code(), answer, stderr(output))
}
