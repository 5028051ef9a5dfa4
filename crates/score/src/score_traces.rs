//! From traces to the episode table: the columns that the plan needs, one scan, one sorted table.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use arrow::array::RecordBatch;
use arrow::compute::filter_record_batch;

use super::builder::TableBuilder;
use super::declared_experiments::{DeclarationError, declare};
use super::error::EngineError;
use super::evaluate::{Batch, BatchScores};
use super::physical::PhysicalPlan;
use super::quality::{QualityByCell, QualityReader};
use super::segments::Segments;
use super::table::{EpisodeTable, Header};
use super::timeline::{Timeline, TimelineReader, in_key_order};
use exact::budget::Limit;
use exact::suggest::nearest;
use metric::catalog::Catalog;
use metric::columns::{Column, Columns, Fallback, Level, Type};
use metric::definitions::{Definitions, UnknownMetric};
use metric::file::{ColumnEntry, FileError};
use metric::restore::RestoreError;
use toml_spec::Faults;
use trace::error::TraceError;
use trace::open::{TraceFile, TraceSet};
use trace::scan::{EPISODE_COLUMNS, EpisodeBatch, Projection};
use trace::schema::domain::is_general;
use trace::schema::{self, COLUMNS, DeclaredColumn, Domain, Kind};

/// The request for a scoring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// A built-in definition file by name, or any other by path.
    pub definitions: PathBuf,
    /// The metrics wanted, by name; all if absent.
    pub metrics: Option<Vec<String>>,
    /// A condition on episodes in the language of definitions; all episodes if absent.
    pub condition: Option<String>,
}

impl Request {
    /// All metrics of a definition file, over all episodes.
    pub fn of(definitions: impl Into<PathBuf>) -> Self {
        Self { definitions: definitions.into(), metrics: None, condition: None }
    }
}

/// An error of scoring traces.
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// The traces are not as they must be.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// The definition file is not.
    #[error(transparent)]
    Definitions(#[from] FileError),
    /// The definitions that scores carry are not.
    #[error(transparent)]
    Carried(#[from] RestoreError),
    /// The experiments that the traces declare are not.
    #[error(transparent)]
    Declaration(#[from] DeclarationError),
    /// The condition on episodes is not.
    #[error(transparent)]
    Condition(#[from] Faults),
    /// A metric was asked for that the definitions do not have.
    #[error(transparent)]
    Metric(#[from] UnknownMetric),
    /// A column that a metric reads is not in every trace.
    #[error("`{wanted_by}` reads the column `{column}`: {problem}; {help}")]
    Column {
        /// The metric, or `--where`.
        wanted_by: String,
        column: String,
        /// The problem, with its file.
        problem: String,
        /// The remedy.
        help: String,
    },
    /// A column to group by is not constant in an episode, or not there.
    #[error("cannot group by `{name}`: expected a column that is constant in an episode, one of {}; {help}", .known.join(", "))]
    Label {
        /// The name given.
        name: String,
        /// The columns that can be grouped by.
        known: Vec<String>,
        /// The remedy.
        help: String,
    },
    /// A number could not be computed.
    #[error("{file}: {source}")]
    Engine {
        /// The file of the batch.
        file: String,
        source: EngineError,
    },
}

/// The columns that definitions may name: those of the schema, whether the traces have them or not.
pub fn schema_columns() -> Columns {
    let column = |column: &trace::schema::Column| {
        let level = if column.constant { Level::Episode } else { Level::Step };
        type_of(column.stored.kind()).map(|ty| (column.name, Column { ty, level }))
    };
    let columns: Columns = COLUMNS.iter().filter(|column| column.name != "t").filter_map(column).collect();
    let lists = COLUMNS.iter().filter(|column| !column.values.is_empty()).map(|column| (column.name, column.values));
    let of_mirror = COLUMNS.iter().map(|column| column.name).filter(|name| !is_general(name));
    let mut columns = columns.with_values(lists).with_mirror(of_mirror);
    // A trace without a required column is an exception that its experiment declares.
    set_fallbacks(&mut columns, |name| schema::column(name).is_some_and(|known| known.required));
    COLUMNS.iter().filter(|column| column.since > 1).for_each(|column| columns.set_free(column.name));
    columns
}

/// The columns that definitions may name over traces of which nothing is known yet: as [`schema_columns`], where each row
/// may have a value.
pub fn unknown_columns() -> Columns {
    let mut columns = schema_columns();
    set_fallbacks(&mut columns, |_| true);
    columns
}

/// Says what columns mean where there is no value; `is_read` says which of them some trace has.
fn set_fallbacks(columns: &mut Columns, is_read: impl Fn(&str) -> bool) {
    for column in COLUMNS.iter() {
        if let Some(expression) = column.default {
            columns.set_fallback(column.name, Fallback { expression, is_read: is_read(column.name) });
        }
    }
}

/// Returns true if a column of this name has a value in each row of each trace.
pub fn has_value(name: &str) -> bool {
    COLUMNS.iter().any(|column| column.name == name && column.required && !column.nullable)
}

/// The columns that definitions may name over these traces: those of the schema, and the traces' own.
pub fn trace_columns(traces: &TraceSet) -> Columns {
    let mut columns =
        schema_columns().with_help("`mirrorstats trace schema` and `mirrorstats trace info` list the columns");
    set_fallbacks(&mut columns, |name| traces.declares(name));
    for column in COLUMNS.iter().filter(|column| !traces.knows(column)) {
        columns.forget(column.name);
    }
    for name in traces.column_names().into_iter().filter(|name| *name != "t") {
        if let Some(ty) = traces.column(name).and_then(|column| type_of(column.kind)) {
            columns.set_own(name, Column { ty, level: Level::Step });
        }
    }
    columns
}

fn type_of(kind: Kind) -> Option<Type> {
    match kind {
        Kind::Bool => Some(Type::Bool),
        Kind::Int => Some(Type::Int),
        Kind::Float => Some(Type::Float),
        Kind::String => Some(Type::Text),
        Kind::Unsupported => None,
    }
}

/// The definitions of a request, checked against the traces, with the experiments that these declare.
pub fn definitions(traces: &TraceSet, request: &Request) -> Result<Definitions, ScoreError> {
    let columns = trace_columns(traces);
    let mut definitions = Definitions::load(&request.definitions, &columns)?;
    if let Some(condition) = &request.condition {
        definitions = definitions.filtered("--where", condition, &columns)?;
    }
    if let Some(metrics) = &request.metrics {
        definitions.select(metrics)?;
    }
    check_columns(traces, &definitions)?;
    declare(&mut definitions.catalog, traces)?;
    Ok(definitions)
}

/// These metrics of the definitions that scores carry, checked against the traces that they were computed from.
pub fn restored(traces: &TraceSet, catalog: &Catalog, metrics: &[String]) -> Result<Definitions, ScoreError> {
    let mut definitions = Definitions::of_catalog(catalog, &trace_columns(traces))?;
    definitions.select(metrics)?;
    check_columns(traces, &definitions)?;
    declare(&mut definitions.catalog, traces)?;
    Ok(definitions)
}

/// Every column that is read must be in every file, with one type.
pub fn check_columns(traces: &TraceSet, definitions: &Definitions) -> Result<(), ScoreError> {
    let plan = &definitions.plan;
    let outputs = plan.outputs.iter().map(|output| (output.name.as_str(), output.node));
    for (wanted_by, node) in outputs.chain(plan.filter.map(|node| ("--where", node))) {
        for (column, _) in plan.columns(&plan.needed_by([node])) {
            if let Some((problem, help)) = column_problem(traces, column) {
                let (wanted_by, column) = (wanted_by.to_owned(), column.to_owned());
                return Err(ScoreError::Column { wanted_by, column, problem, help });
            }
        }
    }
    Ok(())
}

fn column_problem(traces: &TraceSet, column: &str) -> Option<(String, String)> {
    let absent = || "record it, or choose other metrics with --metrics".to_owned();
    let has_default = traces.domain().column(column).is_some_and(|known| known.default.is_some());
    let Some(found) = traces.column(column) else { return Some(("no trace has it".to_owned(), absent())) };
    if let Some([(first, a), (second, b)]) = found.conflict {
        let problem = format!("it is {} in `{first}` and {} in `{second}`", a.name(), b.name());
        return Some((problem, "write it with one type in all traces".to_owned()));
    }
    found.missing_from.filter(|_| !has_default).map(|file| (format!("`{file}` has no such column"), absent()))
}

/// What became of the replies is counted for each of them.
const MOST_CELLS: Limit = Limit::new("experiments times models times conditions whose replies are counted", 100_000);

/// What a scan gives besides the metrics.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outputs<'a> {
    /// Further key columns: columns that are constant in an episode.
    pub labels: &'a [String],
    /// True if the timelines of the first definitions are wanted.
    pub timelines: bool,
    /// The reader of replies, for the episodes that the first definitions keep.
    pub quality: Option<&'a QualityReader>,
    /// Columns whose values are taken unchanged, unless the first definitions read them.
    pub unchecked: &'a [&'a str],
}

/// The results of one scan, with the tables as an array of known length or as a vector.
#[derive(Clone, Debug)]
pub struct Scored<T> {
    /// A table per definitions, each with the episodes that its own filter keeps.
    pub tables: T,
    /// The timelines of the first definitions, in the order of their keys; `None` where they were not asked for, or the
    /// definitions do not name their moments.
    pub timelines: Option<Vec<Timeline>>,
    /// The reply quality; `None` unless requested.
    pub quality: Option<QualityByCell>,
}

/// Scores all episodes of some traces.
///
/// The table is the same for any number of threads, any order of files and any division into row groups.
pub fn score(
    traces: &TraceSet,
    definitions: &Definitions,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, ScoreError> {
    let Scored { tables: [table], .. } =
        score_each(traces, [definitions], Outputs { labels, ..Outputs::default() }, threads)?;
    Ok(table)
}

/// Scores all episodes of some traces under several definitions, in one scan and one plan: what they share is computed
/// once.
pub fn score_each<const N: usize>(
    traces: &TraceSet,
    definitions: [&Definitions; N],
    outputs: Outputs<'_>,
    threads: NonZeroUsize,
) -> Result<Scored<[EpisodeTable; N]>, ScoreError> {
    let Scored { tables, timelines, quality } = score_all(traces, &definitions, outputs, threads)?;
    let tables = tables.try_into().expect("a table per definitions");
    Ok(Scored { tables, timelines, quality })
}

/// As [`score_each`], for a number of definitions that is not known before.
pub fn score_all(
    traces: &TraceSet,
    definitions: &[&Definitions],
    outputs: Outputs<'_>,
    threads: NonZeroUsize,
) -> Result<Scored<Vec<EpisodeTable>>, ScoreError> {
    let mut plan = PhysicalPlan::of(&definitions.iter().map(|definitions| &definitions.plan).collect::<Vec<_>>());
    let first = definitions.first().filter(|_| outputs.timelines);
    let timelines = first.and_then(|definitions| TimelineReader::of(&mut plan, definitions));
    check_work(traces, &plan)?;
    let mut projection = projection(traces, definitions, &plan, outputs.labels)?;
    take_as_they_are(&mut projection, outputs.unchecked, definitions.first());
    if let Some(quality) = outputs.quality {
        let known = |name: &&String| projection.steps.contains(name) || projection.unchecked.contains(name);
        let new = quality.columns().iter().filter(|name| !known(name)).cloned().collect::<Vec<_>>();
        projection.unchecked.extend(new);
        let condition = quality.constants().filter(|name| !projection.constants.contains(name));
        projection.constants.extend(condition);
    }
    let headers = definitions.iter().map(|definitions| header(definitions, outputs.labels)).collect();
    let mut found = timelines.as_ref().map(|_| Vec::new());
    let mut quality = outputs.quality.map(|_| QualityByCell::default());
    let read = |batch: &EpisodeBatch| {
        let values = plan.evaluate(&view(batch))?;
        let scores = plan.scores().iter().map(|scores| values.scores(scores)).collect::<Result<Vec<_>, _>>()?;
        let kept = scores.first().and_then(|scores: &BatchScores| scores.kept.as_ref());
        let quality = outputs.quality.map(|reader| reader.read(batch, kept));
        let timelines = timelines.as_ref().map(|reader| reader.timelines(&values, batch));
        Ok((scores, (timelines, quality)))
    };
    let mut exceeded = None;
    let tables = collect(traces, &projection, headers, threads, read, |(timelines, replies)| {
        found.iter_mut().zip(timelines).for_each(|(found, part)| found.extend(part));
        if let Some((quality, part)) = quality.as_mut().zip(replies).filter(|_| exceeded.is_none()) {
            quality.merge(part);
            exceeded = MOST_CELLS.check(quality.0.len() as u64).err();
        }
    })?;
    if let Some(exceeded) = exceeded {
        return Err(of_first(traces, exceeded.into()));
    }
    Ok(Scored { tables, timelines: found.map(in_key_order), quality })
}

/// Whether the definitions ask for more than files of their size may: known before a row is read.
pub(super) fn check_work(traces: &TraceSet, plan: &PhysicalPlan) -> Result<(), ScoreError> {
    let sum = |of: fn(&TraceFile) -> u64| traces.files().iter().map(of).sum();
    let checked = plan.check_work(sum(TraceFile::rows), sum(TraceFile::bytes));
    checked.map_err(|exceeded| of_first(traces, exceeded.into()))
}

fn of_first(traces: &TraceSet, source: EngineError) -> ScoreError {
    ScoreError::Engine { file: traces.files().first().map_or("", TraceFile::name).to_owned(), source }
}

fn take_as_they_are(projection: &mut Projection, columns: &[&str], definitions: Option<&&Definitions>) {
    let (read, _) = definitions.map(|definitions| PhysicalPlan::of(&[&definitions.plan]).columns()).unwrap_or_default();
    let is_free = |name: &String| columns.contains(&name.as_str()) && !read.contains(name);
    let (free, steps) = std::mem::take(&mut projection.steps).into_iter().partition::<Vec<_>, _>(is_free);
    projection.steps = steps;
    projection.unchecked.extend(free);
}

pub(super) fn header(definitions: &Definitions, labels: &[String]) -> Header {
    let metrics = definitions.plan.outputs.iter().map(|output| output.name.clone()).collect();
    Header { catalog: definitions.catalog.clone(), labels: labels.to_vec(), metrics }
}

/// The episodes of some traces without a metric: keys and labels, the traces checked as [`score`] checks them.
///
/// For engines that read the traces themselves and check nothing.
pub fn unscored(
    traces: &TraceSet,
    definitions: &Definitions,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, ScoreError> {
    let projection = projection(traces, &[definitions], &PhysicalPlan::of(&[&definitions.plan]), labels)?;
    let header = Header { catalog: definitions.catalog.clone(), labels: labels.to_vec(), metrics: Vec::new() };
    let nothing = |_: &EpisodeBatch| Ok((vec![BatchScores { kept: None, metrics: Vec::new() }], ()));
    let mut tables = collect(traces, &projection, vec![header], threads, nothing, |()| {})?;
    Ok(tables.pop().expect("a table per header"))
}

/// The tables of what `score` gives for each batch; what else it gives goes to `other`, in the order of the files.
pub(super) fn collect<T: Send>(
    traces: &TraceSet,
    projection: &Projection,
    headers: Vec<Header>,
    threads: NonZeroUsize,
    score: impl Fn(&EpisodeBatch) -> Result<(Vec<BatchScores>, T), EngineError> + Sync,
    mut other: impl FnMut(T),
) -> Result<Vec<EpisodeTable>, ScoreError> {
    let mut builders: Vec<TableBuilder> = headers.into_iter().map(TableBuilder::new).collect();
    traces.scan(
        projection,
        threads,
        |batch| -> Result<_, ScoreError> {
            let (scores, more) = score(&batch).map_err(|source| failed(traces, &batch, source))?;
            let parts = scores.into_iter().map(|scores| (kept(&batch.episodes, &scores), scores.metrics));
            Ok((parts.collect::<Vec<_>>(), more))
        },
        |(parts, more)| {
            for (builder, (episodes, metrics)) in builders.iter_mut().zip(parts) {
                builder.extend(&episodes, &metrics);
            }
            other(more);
            Ok(())
        },
    )?;
    Ok(builders.into_iter().map(TableBuilder::finish).collect())
}

fn kept(episodes: &RecordBatch, scores: &BatchScores) -> RecordBatch {
    match &scores.kept {
        Some(kept) => filter_record_batch(episodes, kept).expect("a filter has a value for each episode"),
        None => episodes.clone(),
    }
}

pub(super) fn failed(traces: &TraceSet, batch: &EpisodeBatch, source: EngineError) -> ScoreError {
    ScoreError::Engine { file: traces.files()[batch.origin.file].name().to_owned(), source }
}

pub(super) fn view(batch: &EpisodeBatch) -> Batch<'_> {
    Batch {
        segments: Segments::new(&batch.offsets),
        steps: &batch.steps,
        texts: &batch.texts,
        episodes: &batch.episodes,
    }
}

pub(super) fn projection(
    traces: &TraceSet,
    definitions: &[&Definitions],
    plan: &PhysicalPlan,
    labels: &[String],
) -> Result<Projection, ScoreError> {
    let (steps, mut constants) = plan.columns();
    for label in labels {
        check_label(traces, label)?;
        if traces.column(label).is_some() {
            constants.push(label.clone());
        }
    }
    let mut seen = Vec::new();
    constants.retain(|name| {
        let new = !EPISODE_COLUMNS.contains(&name.as_str()) && !seen.contains(name);
        seen.push(name.clone());
        new
    });
    let declared = definitions.iter().flat_map(|definitions| declared_columns(definitions)).collect();
    Ok(Projection { steps, constants, declared, experiments: experiments(definitions), ..Projection::default() })
}

/// The columns of their own that definitions declare.
pub fn declared_columns(definitions: &Definitions) -> Vec<DeclaredColumn> {
    let own = |(name, entry): (&str, &ColumnEntry)| DeclaredColumn {
        name: name.to_owned(),
        kind: kind_of(entry.column.ty),
        values: entry.values.clone(),
        constant: entry.column.level == Level::Episode,
    };
    definitions.declared_columns().map(own).collect()
}

const fn kind_of(ty: Type) -> Kind {
    match ty {
        Type::Bool => Kind::Bool,
        Type::Int => Kind::Int,
        Type::Float => Kind::Float,
        Type::Text => Kind::String,
    }
}

/// The experiments that all definitions know; any if `None`.
fn experiments(definitions: &[&Definitions]) -> Option<Vec<String>> {
    let closed = definitions.iter().map(|definitions| &definitions.catalog).filter(|catalog| !catalog.open);
    let known = closed.map(|catalog| catalog.experiment.keys().cloned().collect::<Vec<_>>());
    known.reduce(|mut all, some| {
        all.retain(|name| some.contains(name));
        all
    })
}

/// Returns true if a column of the schema has one value in all steps of an episode.
pub fn is_constant(name: &str) -> bool {
    COLUMNS.iter().any(|column| column.name == name && column.constant)
}

/// Refuses a column to group by that is not constant in an episode, or not in every trace.
pub fn check_label(traces: &TraceSet, label: &str) -> Result<(), ScoreError> {
    let problem = column_problem(traces, label);
    // What version 2 brought is null in older traces, or has a meaning where there is no value.
    let is_known_anyway = traces.domain().column(label).is_some_and(|known| {
        let found = traces.column(label);
        known.default_text().is_some() || known.since > 1 && found.is_some_and(|found| found.conflict.is_none())
    });
    // Whether a column of one's own changes from step to step shows when it is read.
    let is_constant = |name: &str| match traces.domain() {
        Domain::Mirror => is_constant(name),
        Domain::Own => {
            name != "t" && traces.column(name).is_some_and(|column| matches!(column.kind, Kind::Int | Kind::String))
        }
    };
    if is_constant(label) && (problem.is_none() || is_known_anyway) {
        return Ok(());
    }
    let known: Vec<String> =
        traces.column_names().into_iter().filter(|name| is_constant(name)).map(str::to_owned).collect();
    let near = nearest(label, known.iter().map(String::as_str)).filter(|near| *near != label);
    let help = match (near, problem) {
        (Some(near), _) => format!("did you mean `{near}`?"),
        (None, Some((problem, _))) => problem,
        (None, None) => "its value changes from step to step".to_owned(),
    };
    Err(ScoreError::Label { name: label.to_owned(), known, help })
}

#[cfg(test)]
mod tests {
    use super::*;
    use trace::inputs;

    #[test]
    fn one_scan_equals_several() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper").to_owned();
        let traces = TraceSet::open(&inputs::resolve(&[folder.into()], std::io::empty()).unwrap()).unwrap();
        let condition = Some("seed = 1".to_owned());
        let seed = definitions(&traces, &Request { condition, ..Request::of("paper") }).unwrap();
        let metrics = Some(vec!["TSA".to_owned(), "MGD".to_owned()]);
        let some = definitions(&traces, &Request { metrics, ..Request::of("paper") }).unwrap();
        let threads = NonZeroUsize::new(2).unwrap();
        let labels = ["body_color".to_owned()];
        let outputs = Outputs { labels: &labels, timelines: true, ..Outputs::default() };
        let found = score_each(&traces, [&seed, &some], outputs, threads).unwrap();
        for (table, definitions) in found.tables.iter().zip([&seed, &some]) {
            assert_eq!(*table, score(&traces, definitions, outputs.labels, threads).unwrap());
        }
        let all = score_all(&traces, &[&seed, &some], outputs, threads).unwrap();
        assert_eq!((all.tables.as_slice(), &all.timelines), (found.tables.as_slice(), &found.timelines));
        assert_eq!(found.tables.map(|table| table.len()), [280, 840]);
        assert_eq!(found.timelines, score_each(&traces, [&seed], outputs, threads).unwrap().timelines);
        assert_eq!(found.timelines.unwrap().len(), 280);
    }
}
