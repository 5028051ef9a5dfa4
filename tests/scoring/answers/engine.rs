//! The tables, and the answers of both engines to a statement.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use mirrorstats_engines::polars::answer::plan;
use mirrorstats_engines::polars::refused::QueryError;
use mirrorstats_engines::polars::run::PolarsError;
use mirrorstats_engines::polars::shared_file::write_file;
use mirrorstats_engines::polars::statement::{Table, check};
use polars::prelude::{AnyValue, DataFrame, Engine, IntoLazy as _, LazyFrame, df};
use serde_json::Value;

use super::generate::Draw;
use crate::harness::need;

#[derive(Clone, Debug)]
pub enum Cell {
    Null,
    Bool(bool),
    Text(String),
    Number(f64, String),
}

impl Cell {
    fn key(&self) -> (u8, String) {
        match self {
            Self::Null => (0, String::new()),
            Self::Bool(value) => (1, value.to_string()),
            Self::Text(text) => (2, text.clone()),
            // Rounded, so that neighbours sort alike.
            Self::Number(value, _) => (3, format!("{:.9e}", value + 0.0)),
        }
    }

    pub fn same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Null, Self::Null) => true,
            (Self::Bool(a), Self::Bool(b)) => a == b,
            (Self::Text(a), Self::Text(b)) => a == b,
            (Self::Number(a, texts), Self::Number(b, others)) => {
                let near = (a - b).abs() <= 1e-12 * a.abs().max(b.abs()) + 1e-13;
                texts == others || a == b || (a.is_nan() && b.is_nan()) || (near && !(is_int(texts) && is_int(others)))
            }
            _ => false,
        }
    }
}

fn is_int(text: &str) -> bool {
    !text.is_empty()
}

pub type Rows = Vec<Vec<Cell>>;

pub fn sorted(mut rows: Rows) -> Rows {
    rows.sort_by_cached_key(|row| row.iter().map(Cell::key).collect::<Vec<_>>());
    rows
}

pub struct Tables {
    steps: DataFrame,
    episodes: DataFrame,
}

impl Tables {
    pub fn random(draw: &mut Draw) -> Self {
        let rows = draw.below(3) * 17;
        let ids = ["a", "b", "c", "d", "zz"];
        let texts = ["", "A", "a", "ab", "a%b", " pad ", "Äé", "true", "10"];
        let column = |draw: &mut Draw, of: &dyn Fn(&mut Draw) -> i64| -> Vec<Option<i64>> {
            (0..rows).map(|_| (draw.below(4) > 0).then(|| of(draw))).collect()
        };
        let small: Vec<Option<i64>> = column(draw, &|draw| draw.between(-3, 3));
        let large = column(draw, &|draw| draw.between(-40, 40) * 1_000_000_007);
        let floats: Vec<Option<f64>> =
            column(draw, &|draw| draw.between(-9, 9)).iter().map(|n| n.map(|n| n as f64 / 4.0)).collect();
        let singles: Vec<Option<f32>> = floats.iter().map(|x| x.map(|x| x as f32 / 3.0)).collect();
        let flags: Vec<Option<bool>> =
            column(draw, &|draw| draw.between(0, 1)).iter().map(|n| n.map(|n| n == 1)).collect();
        let strings: Vec<Option<&str>> =
            column(draw, &|draw| draw.between(0, 8)).iter().map(|n| n.map(|n| texts[n as usize])).collect();
        let keys: Vec<&str> = (0..rows).map(|_| ids[draw.below(5)]).collect();
        let t: Vec<i32> = (0..rows).map(|row| i32::try_from(row).unwrap()).collect();
        let k: Vec<Option<i8>> = small.iter().map(|n| n.map(|n| n as i8)).collect();
        let steps = df!("episode_id" => keys, "t" => t, "k" => k, "i" => large, "j" => small, "x" => floats, "f" => singles, "b" => flags, "s" => strings);
        let episodes = df!(
            "episode_id" => ["a", "b", "c", "d"], "model" => [Some("m"), Some("n"), None, Some("m")], "seed" => [1, 1, 2, -2],
            "TSA" => [Some(1_i64), Some(0), None, Some(1)], "rate" => [Some(0.5), None, Some(-1.25), Some(0.5)],
            "label_odd" => [Some(true), None, Some(false), None]
        );
        Self { steps: steps.unwrap(), episodes: episodes.unwrap() }
    }

    fn frames(&self) -> Vec<(Table, LazyFrame)> {
        vec![(Table::Steps, self.steps.clone().lazy()), (Table::Episodes, self.episodes.clone().lazy())]
    }

    pub fn write(&self, folder: &Path) {
        for (table, frame) in self.frames() {
            let file = std::fs::File::create(folder.join(format!("{}.parquet", table.name()))).unwrap();
            write_file(frame, mirrorstats_engines::polars::answer::Format::Parquet, file).unwrap();
        }
    }

    /// The rows, or why there are none.
    pub fn answer(&self, sql: &str) -> Result<Rows, QueryError> {
        let frame = plan(&check(sql)?, self.frames())?;
        let rows = frame.collect_with_engine(Engine::Streaming).map_err(PolarsError::from)?.unwrap_single();
        Ok((0..rows.height())
            .map(|row| rows.columns().iter().map(|column| cell(&column.get(row).unwrap())).collect())
            .collect())
    }
}

fn cell(value: &AnyValue) -> Cell {
    match value {
        AnyValue::Null => Cell::Null,
        AnyValue::Boolean(value) => Cell::Bool(*value),
        AnyValue::String(text) => Cell::Text((*text).to_owned()),
        AnyValue::StringOwned(text) => Cell::Text(text.to_string()),
        AnyValue::Float64(value) => Cell::Number(*value, String::new()),
        AnyValue::Float32(value) => Cell::Number((*value).into(), String::new()),
        value if value.is_integer() => Cell::Number(value.extract().unwrap(), value.to_string()),
        other => panic!("{other:?}"),
    }
}

/// DuckDB in one process.
pub struct Duckdb {
    process: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Duckdb {
    pub fn over(folder: &Path) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scoring/answers/ask.py");
        let mut command = Command::new(need::python());
        command.arg(script).arg(folder).env("PYTHONPATH", need::duckdb());
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (input, output) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        Self { process, input, output }
    }

    pub fn answer(&mut self, sql: &str) -> Result<Rows, String> {
        writeln!(self.input, "{}", Value::from(sql)).unwrap();
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        let answer: Value = serde_json::from_str(&line).unwrap();
        let Some(rows) = answer["rows"].as_array() else { return Err(answer["error"].to_string()) };
        Ok(rows.iter().map(|row| row.as_array().unwrap().iter().map(read).collect()).collect())
    }
}

impl Drop for Duckdb {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn read(value: &Value) -> Cell {
    match value {
        Value::Null => Cell::Null,
        Value::Bool(value) => Cell::Bool(*value),
        Value::String(text) => Cell::Text(text.clone()),
        Value::Object(number) => match (number.get("int"), number.get("float")) {
            (Some(text), _) => Cell::Number(text.as_str().unwrap().parse().unwrap(), text.as_str().unwrap().to_owned()),
            (_, Some(Value::String(text))) => Cell::Number(text.parse().unwrap(), String::new()),
            (_, float) => Cell::Number(float.unwrap().as_f64().unwrap(), String::new()),
        },
        other => panic!("{other}"),
    }
}
