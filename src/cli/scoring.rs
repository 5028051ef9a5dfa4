//! From what was typed to the episode table: traces are scored, files of scores are read.

use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::num::NonZeroUsize;

use super::args::{Engine, EngineArgs, ScoringArgs, TraceArgs};
use super::outcome::Failure;
use super::spark;
use crate::base::hash;
use crate::cells::group::KEY_COLUMNS;
use crate::cells::losses::INFRASTRUCTURE;
#[cfg(feature = "polars")]
use crate::engine::polars::{self, run::PolarsError};
use crate::engine::spark::source::is_uri;
use crate::metric::definitions::Definitions;
use crate::metric::file::FileError;
use crate::report::bundle;
use crate::score::format::{self, Format, FormatError, Partition};
use crate::score::score_traces::{self, Request, ScoreError};
use crate::score::select;
use crate::score::table::EpisodeTable;
use crate::trace::in_order::in_order;
use crate::trace::inputs::{self, Input};
use crate::trace::open::TraceSet;

/// The files named on the command line.
///
/// # Errors
/// When an argument names none, or the list on standard input cannot be read.
pub fn resolve(arguments: &TraceArgs) -> Result<Vec<Input>, Failure> {
    if let Some(uri) = arguments.traces.iter().find(|argument| is_uri(argument)) {
        return Err(Failure::Rendered(format!(
            "error: `{uri}`: expected files of this machine, found a URI, which Spark alone can read\n  help: `mirrorstats score --engine spark {uri} -o scores.parquet`, then give the scores"
        )));
    }
    inputs::resolve(&arguments.traces, io::stdin().lock()).map_err(Failure::input)
}

/// The episode table of traces, or of files of scores in their place.
///
/// # Errors
/// Whatever is wrong with the files, the definitions or the condition.
pub fn table(
    inputs: &[Input],
    scoring: &ScoringArgs,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, Failure> {
    let scores: Vec<&Input> = inputs.iter().filter(|input| is_scores(input)).collect();
    match (scores.is_empty(), scores.len() == inputs.len()) {
        (true, _) => score_traces(inputs, scoring, labels, threads),
        (false, true) => read_scores(&scores, scoring),
        (false, false) => Err(Failure::Rendered(format!(
            "error: expected traces or files of scores, found both: `{}` holds scores\n  help: score the traces first, or leave one kind out",
            scores[0].name
        ))),
    }
}

/// Writes a table; Parquet is encoded by `threads` threads.
///
/// # Errors
/// Whatever writing gives.
pub fn write_table(
    table: &EpisodeTable,
    format: Format,
    out: impl io::Write + Send,
    threads: NonZeroUsize,
) -> Result<(), Failure> {
    if format != Format::Parquet {
        return format::write(table, format, out).map_err(unwritten);
    }
    let (encoder, mut writer) = format::parquet::encoder(table, out).map_err(unwritten)?;
    let jobs: Vec<_> = encoder.jobs().collect();
    in_order(threads, &jobs, |job| encoder.encode(*job), |column| writer.append(column?)).map_err(unwritten)?;
    writer.finish().map_err(unwritten)
}

fn unwritten(error: FormatError) -> Failure {
    match error.into_io() {
        Ok(error) => Failure::Output(error),
        Err(other) => Failure::input(other),
    }
}

/// The same table, computed by the engine asked for.
///
/// # Errors
/// As [`table`]; an engine that this build has not; files of scores, of which there is nothing to compute.
pub fn table_on(
    engine: &EngineArgs,
    inputs: &[Input],
    scoring: &ScoringArgs,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, Failure> {
    engine.check()?;
    match engine.engine {
        Engine::Native => table(inputs, scoring, labels, threads),
        Engine::Polars => polars_table(inputs, scoring, labels, threads),
        Engine::Spark => spark::Asked::of_files(inputs, scoring, labels, engine)?.score(labels),
    }
}

/// The table out of the SQL lowering on Polars.
#[cfg(feature = "polars")]
fn polars_table(
    inputs: &[Input],
    scoring: &ScoringArgs,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, Failure> {
    let traces = open_steps(inputs)?;
    let definitions = definitions(&traces, scoring)?;
    polars::score::score(&traces, &definitions, labels, threads).map_err(polars_failure)
}

/// Faults of definitions have their own layout.
#[cfg(feature = "polars")]
pub fn polars_failure(error: PolarsError) -> Failure {
    match error {
        PolarsError::Score(error) => score_failure(error),
        PolarsError::ReaderGone => Failure::Output(io::ErrorKind::BrokenPipe.into()),
        other => Failure::input(other),
    }
}

/// The refusal of a build without Polars.
#[cfg(not(feature = "polars"))]
fn polars_table(_: &[Input], _: &ScoringArgs, _: &[String], _: NonZeroUsize) -> Result<EpisodeTable, Failure> {
    Err(without_polars("--engine polars"))
}

/// What to say where a build has no Polars.
#[cfg(not(feature = "polars"))]
pub fn without_polars(what: &str) -> Failure {
    Failure::Rendered(format!(
        "error: `{what}` needs Polars, which this build has not\n  help: build with it: cargo build --release --features polars"
    ))
}

/// Scores traces.
fn score_traces(
    inputs: &[Input],
    scoring: &ScoringArgs,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, Failure> {
    let traces = open(inputs)?;
    let definitions = definitions(&traces, scoring)?;
    score_traces::score(&traces, &definitions, labels, threads).map_err(score_failure)
}

/// Opens traces.
///
/// # Errors
/// The first fault of a footer.
pub fn open(inputs: &[Input]) -> Result<TraceSet, Failure> {
    TraceSet::open(inputs).map_err(Failure::input)
}

/// Opens traces for an answer that only steps can give.
///
/// # Errors
/// A file of scores, which has no steps; the first fault of a footer.
pub fn open_steps(inputs: &[Input]) -> Result<TraceSet, Failure> {
    match inputs.iter().find(|input| is_scores(input)) {
        None => open(inputs),
        Some(scores) => Err(Failure::Rendered(format!(
            "error: {}: expected traces, found scores, which have no steps\n  help: give the traces that they were computed from",
            scores.name
        ))),
    }
}

/// The definitions asked for, checked against the traces.
///
/// # Errors
/// Every fault of the definitions and the condition.
pub fn definitions(traces: &TraceSet, scoring: &ScoringArgs) -> Result<Definitions, Failure> {
    let request = Request {
        definitions: scoring.definitions_name().to_owned(),
        metrics: scoring.metrics.clone(),
        condition: scoring.condition.clone(),
    };
    score_traces::definitions(traces, &request).map_err(score_failure)
}

/// The names of all metrics of the definitions asked for.
///
/// # Errors
/// Every fault of the definitions.
pub fn metric_names(traces: &TraceSet, scoring: &ScoringArgs) -> Result<Vec<String>, Failure> {
    let definitions = Definitions::load(scoring.definitions_name(), &score_traces::trace_columns(traces));
    Ok(definitions.map_err(definition_failure)?.catalog.metric.into_keys().collect())
}

/// The definitions over the columns of the schema, for traces that are not opened here.
///
/// # Errors
/// Every fault of the definitions and the condition; an unknown metric.
pub fn definitions_unopened(scoring: &ScoringArgs) -> Result<Definitions, Failure> {
    let columns = score_traces::schema_columns();
    let name = scoring.definitions_name();
    let mut definitions = Definitions::load(name, &columns).map_err(definition_failure)?;
    if let Some(condition) = &scoring.condition {
        definitions = definitions
            .filtered("--where", condition, &columns)
            .map_err(|faults| Failure::Faults(faults.render(colored())))?;
    }
    if let Some(metrics) = &scoring.metrics {
        definitions.select(metrics).map_err(Failure::input)?;
    }
    Ok(definitions)
}

/// Faults of definitions have their own layout.
pub fn score_failure(error: ScoreError) -> Failure {
    match error {
        ScoreError::Definitions(error) => definition_failure(error),
        ScoreError::Condition(faults) => Failure::Faults(faults.render(colored())),
        other => Failure::input(other),
    }
}

/// Faults of a definition file, underlined.
pub fn definition_failure(error: FileError) -> Failure {
    match error {
        FileError::Faults(faults) => Failure::Faults(faults.render(colored())),
        other @ FileError::Unreadable { .. } => Failure::input(other),
    }
}

/// Whether standard error shows colours.
pub fn colored() -> bool {
    io::IsTerminal::is_terminal(&io::stderr()) && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Whether these are files of scores rather than traces.
pub fn are_scores(inputs: &[Input]) -> bool {
    inputs.iter().any(is_scores)
}

fn is_scores(input: &Input) -> bool {
    match Format::of_name(&input.name) {
        Ok(Format::Csv | Format::JsonLines) => true,
        Ok(Format::Parquet) | Err(_) => {
            let folders = inputs::folder_values(&input.path);
            File::open(&input.path).is_ok_and(|file| format::holds_scores(&file, &folders))
        }
    }
}

/// Whether a file of scores says what it was computed with; text and what other engines write does not.
pub fn carries_definitions(input: &Input) -> bool {
    File::open(&input.path).is_ok_and(|file| format::holds_definitions(&file))
}

/// Reads files of scores and puts them together.
fn read_scores(inputs: &[&Input], scoring: &ScoringArgs) -> Result<EpisodeTable, Failure> {
    let mut whole: Option<EpisodeTable> = None;
    for input in inputs {
        let table = read_one(input, scoring)?;
        whole = Some(match whole {
            None => table,
            Some(whole) => whole.joined(&table).map_err(|error| at(input, error))?,
        });
    }
    let table = whole.unwrap_or_else(|| unreachable!("the caller has found a file of scores"));
    select::select(table, scoring.metrics.as_deref(), scoring.condition.as_deref()).map_err(|error| match error {
        select::SelectError::Condition(faults) => Failure::Faults(faults.render(colored())),
        other => Failure::input(other),
    })
}

fn read_one(input: &Input, scoring: &ScoringArgs) -> Result<EpisodeTable, Failure> {
    let file = File::open(&input.path).map_err(|error| at(input, error))?;
    let named =
        || Definitions::load(scoring.definitions_name(), &score_traces::schema_columns()).map_err(definition_failure);
    match Format::of_name(&input.name) {
        Ok(text @ (Format::Csv | Format::JsonLines)) => {
            format::read_text(text, &named()?.catalog, file).map_err(|error| at(input, error))
        }
        Ok(Format::Parquet) | Err(_) => {
            let named = if format::holds_definitions(&file) { None } else { Some(named()?.catalog) };
            let folders = inputs::folder_values(&input.path);
            let partition = Partition { folders: &folders, definitions: named.as_ref() };
            let table = format::read_parquet(file, &partition).map_err(|error| at(input, error))?;
            match &scoring.definitions {
                Some(name) => check_hash(name, input, table),
                None => Ok(table),
            }
        }
    }
}

/// Scores keep the definitions that they were computed with.
fn check_hash(name: &str, input: &Input, table: EpisodeTable) -> Result<EpisodeTable, Failure> {
    let definitions = Definitions::load(name, &score_traces::schema_columns()).map_err(definition_failure)?;
    if definitions.catalog.hash == table.catalog.hash {
        return Ok(table);
    }
    Err(Failure::Rendered(format!(
        "error: {}: expected scores under `{name}` ({}), found scores under `{}` ({})\n  help: score the traces again with --definitions {name}",
        input.name,
        &definitions.catalog.hash[..12],
        table.catalog.name,
        table.catalog.hash.get(..12).unwrap_or_default(),
    )))
}

/// An error with the file it is about.
fn at(input: &Input, error: impl std::error::Error) -> Failure {
    let mut text = format!("error: {}: {error}", input.name);
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str("\n  caused by: ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    Failure::Rendered(text)
}

/// The columns among those to group by that a score does not have by itself.
pub fn labels(by: &[String]) -> Vec<String> {
    by.iter().filter(|name| !KEY_COLUMNS.contains(&name.as_str())).cloned().collect()
}

/// The episodes that the infrastructure ended: without `done`, their last reply lost. `None` where the files do not say.
///
/// # Errors
/// What is wrong with the traces.
pub fn lost(inputs: &[Input], threads: NonZeroUsize) -> Result<Option<BTreeSet<String>>, Failure> {
    if are_scores(inputs) {
        return Ok(None);
    }
    let traces = open(inputs)?;
    if traces.column("reply_status").is_none_or(|column| column.missing_from.is_some() || column.conflict.is_some()) {
        return Ok(None);
    }
    let columns = score_traces::trace_columns(&traces);
    let statuses: Vec<String> = INFRASTRUCTURE.iter().map(|status| format!("'{status}'")).collect();
    let ended = format!("first(action = 'done') is null and at(reply_status, length()) in ({})", statuses.join(", "));
    let nothing = Definitions::from_toml("losses", "", &columns).map_err(definition_failure)?;
    let definitions = nothing.filtered("losses", &ended, &columns).map_err(Failure::input)?;
    let table = score_traces::score(&traces, &definitions, &[], threads).map_err(score_failure)?;
    Ok(Some(table.keys.iter().map(|key| key.episode_id.to_owned()).collect()))
}

/// The experiments that the definitions know; any if `None`.
///
/// # Errors
/// Every fault of the definitions.
pub fn known_experiments(definitions: &str) -> Result<Option<Vec<String>>, Failure> {
    let catalog = Definitions::load(definitions, &score_traces::schema_columns()).map_err(definition_failure)?.catalog;
    Ok((!catalog.open).then(|| catalog.experiment.keys().cloned().collect()))
}

/// The inputs as a manifest names them, with their hashes.
///
/// # Errors
/// When a file cannot be read again.
pub fn provenance(inputs: &[Input]) -> Result<Vec<bundle::Input>, Failure> {
    let one = |input: &Input| {
        let file = File::open(&input.path)?;
        let bytes = file.metadata()?.len();
        Ok(bundle::Input::new(input.name.as_ref(), hash::of_reader(file)?, bytes))
    };
    inputs.iter().map(|input| one(input).map_err(|error: io::Error| at(input, error))).collect()
}
