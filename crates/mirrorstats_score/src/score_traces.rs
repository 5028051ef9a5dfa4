//! From traces to the episode table: the plan's columns, one scan, one sorted table.

use std::collections::{BTreeSet, HashSet};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{Int64Array, RecordBatch};
use arrow::compute::filter_record_batch;

use super::error::{EngineError, ScoreError};
use super::kernels::evaluate::{Batch, BatchScores};
use super::kernels::segments::Segments;
use super::physical::PhysicalPlan;
use super::quality::{QualityByCell, QualityReader};
use super::tables::builder::TableBuilder;
use super::tables::declared_experiments::declare;
use super::tables::table::{EpisodeTable, Header};
use super::timeline::{Timeline, TimelineReader, in_key_order};
use super::vocabulary::{check_columns, check_label, declared_columns, trace_columns};
use mirrorstats_exact::budget::Limit;
use mirrorstats_metric::catalogs::catalog::Catalog;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_trace::read::open::{TraceFile, TraceSet};
use mirrorstats_trace::scan::{EPISODE_COLUMNS, EpisodeBatch, Projection};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    pub definitions: PathBuf,
    pub metrics: Option<Vec<String>>,
    /// A condition on episodes in the language of definitions; all episodes if absent.
    pub condition: Option<String>,
}

impl Request {
    pub fn of(definitions: impl Into<PathBuf>) -> Self {
        Self { definitions: definitions.into(), metrics: None, condition: None }
    }
}

/// The definitions of a request, checked against the traces, including the experiments that the traces declare.
pub fn definitions(traces: &TraceSet, request: &Request) -> Result<Definitions, ScoreError> {
    let columns = trace_columns(traces);
    let mut definitions = Definitions::load(&request.definitions, &columns)?;
    if let Some(condition) = &request.condition {
        definitions = definitions.filtered("--where", condition, &columns)?;
    }
    if let Some(metrics) = &request.metrics {
        definitions.select(metrics)?;
    }
    checked(traces, definitions)
}

/// These metrics of the definitions that scores carry, checked against the traces of the scores.
pub fn restored(traces: &TraceSet, catalog: &Catalog, metrics: &[String]) -> Result<Definitions, ScoreError> {
    let mut definitions = Definitions::of_catalog(catalog, &trace_columns(traces))?;
    definitions.select(metrics)?;
    checked(traces, definitions)
}

/// The definitions with the experiments that the traces declare, if the traces have the columns that are read.
pub fn checked(traces: &TraceSet, mut definitions: Definitions) -> Result<Definitions, ScoreError> {
    check_columns(traces, &definitions)?;
    declare(&mut definitions.catalog, traces)?;
    Ok(definitions)
}

const MOST_CELLS: Limit = Limit::new("experiments times models times conditions whose replies are counted", 100_000);

/// The outputs of a scan besides the metrics.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outputs<'a> {
    /// Further key columns: columns that are constant in an episode.
    pub labels: &'a [String],
    /// True to collect the timelines of the first definitions.
    pub timelines: bool,
    /// The reader of replies, for the episodes that the first definitions keep.
    pub quality: Option<&'a QualityReader>,
    /// Columns whose values are taken unchanged, unless the first definitions read them.
    pub unchecked: &'a [&'a str],
    /// True to look for episodes that may be copies of others.
    pub copy_candidates: bool,
}

#[derive(Clone, Debug)]
pub struct Scored {
    /// A table per definitions.
    pub tables: Vec<EpisodeTable>,
    /// The timelines of the first definitions, in key order. `None` if they were not requested, or if the definitions
    /// do not name their moments.
    pub timelines: Option<Vec<Timeline>>,
    pub quality: Option<QualityByCell>,
    /// The episodes of the first definitions that equal another one in all columns read, except for the id; empty
    /// unless requested.
    pub copy_candidates: BTreeSet<String>,
}

/// Scores all episodes of some traces. The table does not depend on the number of threads, the order of files or the
/// division into row groups.
pub fn score(
    traces: &TraceSet,
    definitions: &Definitions,
    labels: &[String],
    threads: NonZeroUsize,
) -> Result<EpisodeTable, ScoreError> {
    let scored = score_all(traces, &[definitions], Outputs { labels, ..Outputs::default() }, threads)?;
    Ok(scored.tables.into_iter().next().expect("a table per definitions"))
}

/// Scores all episodes of some traces under several definitions, in one scan and one plan: shared steps are computed
/// once.
pub fn score_all(
    traces: &TraceSet,
    definitions: &[&Definitions],
    outputs: Outputs<'_>,
    threads: NonZeroUsize,
) -> Result<Scored, ScoreError> {
    let mut plan = PhysicalPlan::of(&definitions.iter().map(|definitions| &definitions.plan).collect::<Vec<_>>());
    let first = definitions.first().filter(|_| outputs.timelines);
    let timelines = first.and_then(|definitions| TimelineReader::of(&mut plan, definitions));
    check_work(traces, &plan)?;
    let mut projection = projection(traces, definitions, &plan, outputs.labels)?;
    leave_unchecked(&mut projection, outputs.unchecked, definitions.first());
    if let Some(quality) = outputs.quality {
        let known = |name: &&String| projection.steps.contains(name) || projection.unchecked.contains(name);
        let new = quality.columns().iter().filter(|name| !known(name)).cloned().collect::<Vec<_>>();
        projection.unchecked.extend(new);
        let condition = quality.constants().filter(|name| !projection.constants.contains(name));
        projection.constants.extend(condition);
    }
    projection.row_hashes = outputs.copy_candidates;
    let mut headers: Vec<Header> = definitions.iter().map(|definitions| header(definitions, outputs.labels)).collect();
    // The prints are sorted like a metric, and then taken out.
    if let Some(first) = headers.first_mut().filter(|_| outputs.copy_candidates) {
        first.metrics.push(String::new());
    }
    let mut found = timelines.as_ref().map(|_| Vec::new());
    let mut quality = outputs.quality.map(|_| QualityByCell::default());
    let read = |batch: &EpisodeBatch| {
        let values = plan.evaluate(&view(batch))?;
        let mut scores = plan.scores.iter().map(|scores| values.scores(scores)).collect::<Result<Vec<_>, _>>()?;
        if let Some((first, prints)) = scores.first_mut().zip(batch.row_hashes.as_ref()) {
            let kept = |episode: &usize| first.kept.as_ref().is_none_or(|kept| kept.value(*episode));
            let prints = (0..prints.len()).filter(kept).map(|episode| prints[episode].cast_signed());
            let prints = Int64Array::from_iter_values(prints);
            first.metrics.push(Arc::new(prints));
        }
        let kept = scores.first().and_then(|scores: &BatchScores| scores.kept.as_ref());
        let quality = outputs.quality.map(|reader| reader.read(batch, kept));
        let timelines = timelines.as_ref().map(|reader| reader.timelines(&values, batch));
        Ok((scores, (timelines, quality)))
    };
    let mut exceeded = None;
    let mut tables = collect(traces, &projection, headers, threads, read, |(timelines, replies)| {
        found.iter_mut().zip(timelines).for_each(|(found, part)| found.extend(part));
        if let Some((quality, part)) = quality.as_mut().zip(replies).filter(|_| exceeded.is_none()) {
            quality.merge(part);
            exceeded = MOST_CELLS.check(quality.0.len() as u64).err();
        }
    })?;
    if let Some(exceeded) = exceeded {
        return Err(of_first(traces, exceeded.into()));
    }
    let copy_candidates =
        tables.first_mut().filter(|_| outputs.copy_candidates).map(copy_candidates).unwrap_or_default();
    Ok(Scored { tables, timelines: found.map(in_key_order), quality, copy_candidates })
}

/// The episodes that share their print with another one. Takes the prints out of the table.
fn copy_candidates(table: &mut EpisodeTable) -> BTreeSet<String> {
    let prints: Vec<i64> = table.metrics.pop().map(|prints| prints.iter().flatten().collect()).unwrap_or_default();
    let mut sorted = prints.clone();
    sorted.sort_unstable();
    let repeated: HashSet<i64> = sorted.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0]).collect();
    if repeated.is_empty() {
        return BTreeSet::new();
    }
    let rows = table.keys.iter().zip(&prints).filter(|(_, print)| repeated.contains(print));
    rows.map(|(key, _)| key.episode_id.to_owned()).collect()
}

/// Checks the work that the definitions ask for against the size of the files, before a row is read.
pub(super) fn check_work(traces: &TraceSet, plan: &PhysicalPlan) -> Result<(), ScoreError> {
    let sum = |of: fn(&TraceFile) -> u64| traces.files().iter().map(of).sum();
    let checked = plan.check_work(sum(TraceFile::rows), sum(TraceFile::bytes));
    checked.map_err(|exceeded| of_first(traces, exceeded.into()))
}

fn of_first(traces: &TraceSet, source: EngineError) -> ScoreError {
    ScoreError::Engine { file: traces.files().first().map_or("", TraceFile::name).to_owned(), source }
}

fn leave_unchecked(projection: &mut Projection, columns: &[&str], definitions: Option<&&Definitions>) {
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

/// The tables that `score` gives for each batch; its other output goes to `other`, in the order of the files.
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

/// The experiments that all definitions know; any if `None`.
fn experiments(definitions: &[&Definitions]) -> Option<Vec<String>> {
    let closed = definitions.iter().map(|definitions| &definitions.catalog).filter(|catalog| !catalog.open);
    let known = closed.map(|catalog| catalog.experiment.keys().cloned().collect::<Vec<_>>());
    known.reduce(|mut all, some| {
        all.retain(|name| some.contains(name));
        all
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mirrorstats_trace::inputs;

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
        let found = score_all(&traces, &[&seed, &some], outputs, threads).unwrap();
        for (table, definitions) in found.tables.iter().zip([&seed, &some]) {
            assert_eq!(*table, score(&traces, definitions, outputs.labels, threads).unwrap());
        }
        assert_eq!(found.tables.iter().map(EpisodeTable::len).collect::<Vec<_>>(), [280, 840]);
        assert_eq!(found.timelines, score_all(&traces, &[&seed], outputs, threads).unwrap().timelines);
        assert_eq!(found.timelines.unwrap().len(), 280);
    }
}
