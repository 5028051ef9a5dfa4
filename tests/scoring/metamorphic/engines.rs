//! The answers of each engine to a batch of cases; an external engine gets all cases in one process.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::process::Command;

use mirrorstats_metric::columns::{Column, ColumnOrigin, Columns, KnownColumn, Level, Type};
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::logical_plan::plan::Output;
use mirrorstats_metric::sql::{self, Dialect};
use mirrorstats_score::score_traces;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::read::open::TraceSet;
use serde_json::{Value, json};

use crate::differential::trace::{Sheet, open};
use crate::harness::need;
use crate::traces::free_columns;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    Native,
    Duckdb,
    Spark,
}

/// Traces, definitions, and conditions on episodes for further queries.
#[derive(Debug)]
pub struct Case {
    pub text: String,
    pub sheets: Vec<Sheet>,
    pub filters: Vec<&'static str>,
}

/// The metrics by name, and their values for each episode.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rows {
    pub names: Vec<String>,
    pub values: BTreeMap<String, Vec<Option<i64>>>,
}

/// The answer without a filter, then one for each filter; refusals as text.
pub type Answers = Vec<Result<Rows, String>>;

impl Rows {
    pub fn place(&self, name: &str) -> usize {
        self.names.iter().position(|known| known == name).unwrap()
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "definitions:\n{}\ntraces:\n{:#?}", self.text, self.sheets)
    }
}

/// The answers, if every one is a success.
pub fn rows(answers: &Answers) -> Option<Vec<Rows>> {
    answers.iter().map(|answer| answer.as_ref().ok().cloned()).collect()
}

/// The answer of an engine to each case.
pub fn answers(engine: Engine, cases: &[Case]) -> Vec<Answers> {
    let folder = tempfile::tempdir().unwrap();
    let prepared: Vec<Prepared> =
        cases.iter().enumerate().map(|(at, case)| Prepared::of(folder.path(), at, case)).collect();
    answers_to(engine, folder.path(), &prepared)
}

/// The answers of an engine on all traces in `folder`.
pub fn answers_about(
    engine: Engine,
    folder: &Path,
    traces: TraceSet,
    definitions: Definitions,
) -> Result<Rows, String> {
    let place = folder.join("traces").to_str().unwrap().to_owned();
    let columns = columns(&traces);
    let prepared = Prepared { folder: place, traces, columns, definitions: vec![definitions] };
    answers_to(engine, folder, &[prepared]).remove(0).remove(0)
}

/// The columns of these traces; columns that no file has are included, and are null.
pub fn columns(traces: &TraceSet) -> Columns {
    let mut columns = free_columns(traces);
    for (name, ty) in [
        ("points", Type::Int),
        ("n4", Type::Int),
        ("weight", Type::Float),
        ("note", Type::Text),
        ("grip open", Type::Bool),
    ] {
        columns.add(name, KnownColumn::new(Column { ty, level: Level::Step }, ColumnOrigin::Own));
    }
    columns
}

/// Loads the definitions for these traces.
pub fn load(traces: &TraceSet, text: &str) -> Definitions {
    Definitions::from_toml("random", text, &columns(traces)).unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

fn answers_to(engine: Engine, folder: &Path, prepared: &[Prepared]) -> Vec<Answers> {
    match engine {
        Engine::Native => each(prepared, |traces, definitions| {
            score_traces::score(traces, definitions, &[], NonZeroUsize::MIN).map_err(|error| error.to_string())
        }),
        Engine::Duckdb => outside("duckdb", &need::duckdb(), Dialect::Duckdb, folder, prepared),
        Engine::Spark => outside("spark", &need::spark(), Dialect::Spark, folder, prepared),
    }
}

/// A case with its traces on disk.
struct Prepared {
    folder: String,
    traces: TraceSet,
    columns: Columns,
    definitions: Vec<Definitions>,
}

impl Prepared {
    fn of(folder: &Path, at: usize, case: &Case) -> Self {
        let folder = folder.join(at.to_string());
        fs::create_dir(&folder).unwrap();
        let traces = open(&folder, &case.sheets);
        let columns = columns(&traces);
        let whole = load(&traces, &case.text);
        let filtered = case.filters.iter().map(|filter| {
            whole.clone().filtered("filter", filter, &columns).unwrap_or_else(|faults| panic!("{faults}\n{case}"))
        });
        let definitions = std::iter::once(whole.clone()).chain(filtered).collect();
        Self { folder: folder.to_str().unwrap().to_owned(), traces, columns, definitions }
    }
}

fn each(cases: &[Prepared], score: impl Fn(&TraceSet, &Definitions) -> Result<EpisodeTable, String>) -> Vec<Answers> {
    let one = |case: &Prepared| {
        let answer = |definitions| score(&case.traces, definitions).map(|table| of_table(&table));
        case.definitions.iter().map(answer).collect()
    };
    cases.iter().map(one).collect()
}

fn of_table(table: &EpisodeTable) -> Rows {
    let names = table.metrics.iter().map(|metric| metric.name.clone()).collect();
    let row = |row: usize| table.metrics.iter().map(|metric| metric.get(row)).collect();
    let values = table.keys.iter().enumerate().map(|(at, key)| (key.episode_id.to_owned(), row(at)));
    Rows { names, values: values.collect() }
}

/// Runs the statements of all cases in one process.
fn outside(engine: &str, packages: &Path, dialect: Dialect, folder: &Path, cases: &[Prepared]) -> Vec<Answers> {
    let request: Vec<Value> = cases.iter().map(|case| request(case, dialect)).collect();
    let file = folder.join("request.json");
    fs::write(&file, json!(request).to_string()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scoring/metamorphic/outside.py");
    let mut command = Command::new(need::python());
    let output =
        command.arg(script).arg(engine).arg(&file).env("PYTHONPATH", packages).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answers: Vec<Vec<Value>> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answers.len(), cases.len());
    let of_case = |(answers, case): (Vec<Value>, &Prepared)| {
        let outputs = &case.definitions[0].plan.outputs;
        answers.into_iter().map(|answer| of_json(outputs, &answer)).collect()
    };
    answers.into_iter().zip(cases).map(of_case).collect()
}

fn request(case: &Prepared, dialect: Dialect) -> Value {
    let kind = |ty| match ty {
        Type::Bool => "bool",
        Type::Int => "int",
        Type::Float => "float",
        Type::Text => "string",
    };
    let typed = |name: &str| case.columns.known(name).map(|known| (name.to_owned(), kind(known.column.ty)));
    let mut columns: BTreeMap<String, &str> = case.columns.names().filter_map(typed).collect();
    for (name, kind) in [("t", "int"), ("episode_id", "string")] {
        columns.insert(name.to_owned(), kind);
    }
    let statements = case.definitions.iter().map(|definitions| sql::lower(&definitions.plan, dialect).unwrap());
    let statements: Vec<String> = statements.collect();
    json!({ "folder": case.folder, "columns": columns, "statements": statements })
}

/// Rows with an episode's five keys and its metrics; an error is a text. A metric with decimals is a double there.
fn of_json(outputs: &[Output], answer: &Value) -> Result<Rows, String> {
    let stored = |value: &Value, decimals: u8| {
        let double = value.as_f64().filter(|_| decimals > 0)?;
        format!("{:.0}", double * 10_f64.powi(decimals.into())).parse().ok()
    };
    let rows = answer.as_array().ok_or_else(|| answer.to_string())?;
    let values = rows.iter().map(|row| {
        let row = row.as_array().unwrap();
        assert_eq!(row.len(), outputs.len() + 5);
        let value = |value: &Value| value.as_i64().or_else(|| value.as_bool().map(i64::from));
        let values = row[5..].iter().zip(outputs).map(|(found, output)| {
            let value = stored(found, output.decimals).or_else(|| value(found));
            assert!(found.is_null() || value.is_some(), "{found} is no value");
            value
        });
        (row[0].as_str().unwrap().to_owned(), values.collect())
    });
    let names = outputs.iter().map(|output| output.name.clone()).collect();
    Ok(Rows { names, values: values.collect() })
}
