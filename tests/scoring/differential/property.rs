//! The property. A run is some files and some definitions; a case is one metric of one episode.

use std::fmt::Write as _;
use std::num::NonZeroUsize;

use ::score::error::EngineError;
use ::score::error::ScoreError;
use ::score::score_traces;
use ::score::table::{EpisodeKey, EpisodeTable};
use ::score::vocabulary;
use engines::polars::run::PolarsError;
use engines::polars::score;
use metric::columns::{Column, Columns, Level, Type};
use metric::definitions::Definitions;
use metric::sql::{self, Dialect};
use proptest::prelude::*;
use proptest::test_runner::{RngSeed, TestRunner};
use trace::open::TraceSet;

use crate::author::definitions;
use crate::differential::trace::{Sheet, open, sheets};
use crate::differential::words::WORDS;
use crate::language::toml;

/// The answer of an engine: its values, or the kind of its refusal.
#[derive(Debug, PartialEq)]
enum Answer {
    Values(Vec<(EpisodeKey, Vec<Option<i64>>)>),
    Overflow,
    NotARate,
    /// Invalid traces, with the message of the reader that both engines share.
    Refused(String),
}

fn values(table: &EpisodeTable) -> Answer {
    let row = |row: usize| table.metrics.iter().map(|metric| metric.get(row)).collect();
    Answer::Values(table.keys.iter().enumerate().map(|(at, key)| (key.to_owned(), row(at))).collect())
}

fn native(traces: &TraceSet, definitions: &Definitions) -> Result<Answer, String> {
    match score_traces::score(traces, definitions, &[], NonZeroUsize::MIN) {
        Ok(table) => Ok(values(&table)),
        Err(ScoreError::Engine { source: EngineError::Overflow { .. }, .. }) => Ok(Answer::Overflow),
        Err(ScoreError::Engine { source: EngineError::NotARate { .. }, .. }) => Ok(Answer::NotARate),
        Err(ScoreError::Trace(error)) => Ok(Answer::Refused(error.to_string())),
        Err(other) => Err(other.to_string()),
    }
}

fn polars(traces: &TraceSet, definitions: &Definitions) -> Result<Answer, String> {
    match score::score(traces, definitions, &[], NonZeroUsize::MIN) {
        Ok(table) => Ok(values(&table)),
        Err(PolarsError::Overflow { .. }) => Ok(Answer::Overflow),
        Err(PolarsError::NotARate { .. }) => Ok(Answer::NotARate),
        Err(PolarsError::Score(ScoreError::Trace(error))) => Ok(Answer::Refused(error.to_string())),
        Err(other) => Err(other.to_string()),
    }
}

/// The columns of these traces; columns that no file has are included, and are null.
pub fn columns(traces: &TraceSet) -> Columns {
    // Allow any column to be compared with any text.
    let mut columns = vocabulary::trace_columns(traces).with_values::<String>([]);
    for (name, ty) in [
        ("points", Type::Int),
        ("n4", Type::Int),
        ("weight", Type::Float),
        ("note", Type::Text),
        ("grip open", Type::Bool),
    ] {
        columns.set_own(name, Column { ty, level: Level::Step });
    }
    columns
}

/// Loads the definitions for these traces.
pub fn load(traces: &TraceSet, text: &str) -> Definitions {
    Definitions::from_toml("random", text, &columns(traces)).unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

/// The engines' disagreement on all metrics at once or, if both refuse, on a single metric; `None` if they agree.
fn disagreement(traces: &TraceSet, definitions: &Definitions) -> Option<String> {
    let (expected, found) = (native(traces, definitions), polars(traces, definitions));
    if expected.is_err() || expected != found {
        return Some(format!("native: {expected:?}\npolars: {found:?}"));
    }
    let names: Vec<String> = definitions.plan.outputs.iter().map(|output| output.name.clone()).collect();
    if names.len() < 2 || matches!(expected, Ok(Answer::Values(_))) {
        return None;
    }
    names.into_iter().find_map(|name| {
        let mut one = definitions.clone();
        one.select(&[name]).unwrap();
        disagreement(traces, &one)
    })
}

/// Everything needed to explain a failure.
fn report(sheets: &[Sheet], text: &str, definitions: &Definitions, what: &str) -> String {
    let mut out = format!("{what}\n\ntraces:\n{sheets:#?}\n\ndefinitions:\n{text}\nnative plan:\n");
    for (id, node) in definitions.plan.ids().zip(definitions.plan.nodes()) {
        let _ = writeln!(out, "{:3} {:?} {:?} {:?}", id.index(), node.level, node.ty, node.op);
    }
    let _ = match sql::lower(&definitions.plan, Dialect::Polars) {
        Ok(statement) => write!(out, "\nstatement:\n{statement}"),
        Err(error) => write!(out, "\nno statement: {error}"),
    };
    out
}

/// Checks this many random runs; a fixed seed gives the same runs.
fn check(runs: u32, rng_seed: RngSeed) {
    let config = ProptestConfig { cases: runs, rng_seed, failure_persistence: None, ..ProptestConfig::default() };
    let mut runner = TestRunner::new(config);
    let outcome = runner.run(&(definitions(&WORDS), sheets()), |(definitions, sheets)| {
        let folder = tempfile::tempdir().unwrap();
        let traces = open(folder.path(), &sheets);
        let text = toml(&definitions);
        let loaded = load(&traces, &text);
        let disagreement = disagreement(&traces, &loaded);
        prop_assert!(disagreement.is_none(), "{}", report(&sheets, &text, &loaded, &disagreement.unwrap_or_default()));
        Ok(())
    });
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn native_and_polars_agree_to_the_last_integer() {
    check(64, RngSeed::Fixed(20));
}

/// `PROPTEST_CASES` new runs each time; without the variable, the same 2000 runs.
#[test]
#[ignore = "soak: 2000 runs"]
fn soak_native_and_polars_agree_to_the_last_integer() {
    match std::env::var("PROPTEST_CASES") {
        Ok(runs) => check(runs.parse().unwrap(), RngSeed::Random),
        Err(_) => check(2000, RngSeed::Fixed(20)),
    }
}
