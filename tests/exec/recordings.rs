//! Recordings of programs in a small world with short episodes.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Command, Output};

use arrow::array::{AsArray as _, RecordBatch};
use arrow::compute::concat_batches;
use mirrorstats::sim::camera::Camera;
use mirrorstats::sim::config::WorldConfig;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;
use tempfile::TempDir;

/// The world seen through a smaller eye, in episodes that are as short as its rooms allow.
const SMALL: &str = "eye.width = 64\neye.height_px = 48\neye.samples = 0\nepisode.steps = 20\n";

/// A reply that moves forward, as the shell writes it.
pub const FORWARD: &str = r#"{"view-description":"a wall","reasoning":"go on","action":"w","summary":"went on","selected_cube":"none","identification":"I am red"}"#;

/// What a program does at each observation to be done at its third.
pub fn three_steps() -> String {
    format!("if [ $n -lt 3 ]; then echo '{FORWARD}'; else echo '{}'; fi", done())
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
    /// `None`, said on standard error, where the machine cannot draw.
    pub fn new() -> Option<Self> {
        let config = WorldConfig::from_toml(SMALL).unwrap();
        if let Err(error) = Camera::new(&config) {
            eprintln!("skipped: {error}");
            return None;
        }
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("small.toml"), SMALL).unwrap();
        Some(Self { folder })
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A program that keeps every line it gets in `heard.jsonl`, and at each observation does what `answer` says.
    pub fn program(&self, answer: &str) {
        let script = format!(
            "while read -r line; do\n  printf '%s\\n' \"$line\" >> heard.jsonl\n  case \"$line\" in\n    \
             *'\"kind\":\"observation\"'*)\n      n=$((n + 1))\n      {answer} ;;\n  esac\ndone\n"
        );
        fs::write(self.path("program.sh"), script).unwrap();
    }

    /// `record` of `sh program.sh` in one episode of E1, if the words do not say otherwise.
    pub fn record(&self, words: &[&str]) -> Command {
        self.record_of("exec:sh program.sh", words)
    }

    pub fn record_of(&self, agent: &str, words: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mirrorstats"));
        command.current_dir(self.folder.path()).args(["record", "--config", "small.toml"]);
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

    /// The lines that programs got, in the order of their coming.
    pub fn heard(&self) -> Vec<Value> {
        let text = fs::read_to_string(self.path("heard.jsonl")).unwrap_or_default();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The list of lost episodes.
    pub fn lost(&self) -> Vec<Value> {
        let text = fs::read_to_string(self.path("runs/lost.jsonl")).unwrap_or_default();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// The rows of a trace.
    pub fn rows(&self, name: &str) -> RecordBatch {
        let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(self.path(name)).unwrap()).unwrap();
        let batches: Vec<_> = reader.build().unwrap().map(Result::unwrap).collect();
        concat_batches(&batches[0].schema(), &batches).unwrap()
    }

    /// A column of text, null as `None`.
    pub fn texts(&self, name: &str, column: &str) -> Vec<Option<String>> {
        let rows = self.rows(name);
        let texts = rows.column_by_name(column).unwrap_or_else(|| panic!("no column {column}"));
        let texts = arrow::compute::cast(texts, &arrow::datatypes::DataType::Utf8).unwrap();
        texts.as_string::<i32>().iter().map(|text| text.map(str::to_owned)).collect()
    }

    /// What stays of a recording besides its traces.
    pub fn leftovers(&self) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.path("runs")) else { return Vec::new() };
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| !name.ends_with(".parquet")).collect()
    }
}

/// The exit code, the answer of `--json`, and what was said.
pub fn outcome(output: &Output) -> (Option<i32>, Value, String) {
    let answer = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output.status.code(), answer, String::from_utf8_lossy(&output.stderr).into_owned())
}
