//! Compares later episodes with earlier ones: one verdict per cell, with the steps that decided each flip.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::slice;

use crate::caveats::{design_of, selection};
use crate::copies::{copies, suspected};
use crate::inputs::Source;
use crate::limits::check_verdicts;
use crate::results::{Outputs, Results};
use crate::{ErrorKind, Study, StudyError, pooled};
use mirrorstats_analysis::gate::{FlippedPair, Gate, GateOptions, Played};
use mirrorstats_exact::number::Decimal;
use mirrorstats_metric::catalogs::catalog::{Better, Metric};
use mirrorstats_metric::definitions::UnknownMetric;
use mirrorstats_score::evidence;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_trace::inputs::{self, Input};
use mirrorstats_trace::read::open::TraceSet;

type OfSide = fn(&mut FlippedPair) -> &mut Played;

/// Compares a later study with an earlier one. Each cell has a verdict, or the reason for none. Errors: as
/// [`Study::score`] for either study; a metric that a side lacks, or without a better direction; a cell that mixes
/// episodes recorded differently; sums of squares beyond 128 bits.
pub fn gate(base: &Study, new: &Study, options: &GateOptions) -> Result<Gate, StudyError> {
    let results = [gated(base, options)?, gated(new, options)?];
    let tables = results.each_ref().map(|results| &results.episodes);
    let design = design_of(&tables[0].declared.clone().joined(tables[1].declared.clone()));
    let mut gate = Gate::between(tables, design, options)?;
    let sides = [("base", base, tables[0]), ("new", new, tables[1])];
    gate.caveats.extend(selection(new, tables[1]).map(|selection| selection.sentence()));
    for (_, study, table) in sides.into_iter().filter(|_| options.pool) {
        gate.caveats.extend(pooled::mixtures(table, &study.question.by_over(table))?);
    }
    for ((side, study, _), results) in sides.into_iter().zip(&results) {
        let copies = copies(study, results)?.map(|copies| copies.sentence);
        let copies = copies.into_iter().chain(suspected(study, results)?.map(|phrase| format!("{phrase}.")));
        gate.caveats.extend(copies.map(|sentence| format!("{side}: {sentence}")));
    }
    let of_side: [OfSide; 2] = [|flip| &mut flip.base, |flip| &mut flip.new];
    let mut caveats = Vec::new();
    for ((side, study, _), of_side) in sides.into_iter().zip(of_side) {
        let mut played: Vec<&mut Played> =
            gate.cells.iter_mut().flat_map(|cell| &mut cell.flips).map(of_side).collect();
        let ids = played.iter().map(|played| played.episode_id.clone()).collect();
        let known = deciding_steps(study, &ids, &options.metric)?;
        for played in &mut played {
            let found = known.get(&played.episode_id).filter(|(value, _)| *value == Some(played.value));
            played.timesteps = found.map(|(_, steps)| steps.clone());
        }
        if study.traces().is_err() && played.iter().any(|played| played.timesteps.is_none()) {
            caveats.push(format!(
                "{side}: scores do not say which steps decided a flip; traces in their folder do, if they give the same value."
            ));
        }
    }
    gate.caveats.extend(caveats);
    Ok(gate)
}

/// The first metric with a better direction. Errors: as [`Study::score`]; definitions without such a metric.
pub fn leading_metric(study: &Study) -> Result<String, StudyError> {
    let catalog = match &study.source {
        Source::Traces(traces) => study.question.bind(traces)?.catalog,
        Source::Scores(_) => study.score()?.episodes.catalog,
    };
    let found = catalog.metric.iter().find(|(_, metric)| metric.better != Better::Neither);
    let first = || catalog.metric.keys().next().cloned().unwrap_or_default();
    found.map(|(name, _)| name.clone()).ok_or_else(|| no_direction(&first()))
}

fn no_direction(metric: &str) -> StudyError {
    let expected = "expected a metric with `better = \"higher\"` or \"lower\", found none";
    StudyError::new(ErrorKind::Argument, format!("{metric}: {expected}\n  help: name another metric with --metric"))
}

fn gated(study: &Study, options: &GateOptions) -> Result<Results, StudyError> {
    let results = study.scan(Outputs { copy_candidates: true, design: true, ..Outputs::default() })?;
    let table = &results.episodes;
    study.check_filter(table.len())?;
    check_verdicts(table)?;
    if check_metric(table, &options.metric)?.better == Better::Neither {
        return Err(no_direction(&options.metric));
    }
    if !options.pool {
        pooled::check(table, &study.question.by_over(table))?;
    }
    Ok(results)
}

/// The value of each episode, and the timesteps that decided it.
type DecidingSteps = BTreeMap<String, (Option<Decimal>, Vec<i64>)>;

fn deciding_steps(study: &Study, ids: &BTreeSet<String>, metric: &str) -> Result<DecidingSteps, StudyError> {
    match &study.source {
        _ if ids.is_empty() => Ok(DecidingSteps::new()),
        Source::Traces(traces) => deciding_steps_in(study, traces, ids, metric),
        // Files beside scores may belong to other episodes, which is no fault of the scores.
        Source::Scores(_) => {
            let beside = traces_beside(study);
            Ok(beside.and_then(|traces| deciding_steps_in(study, &traces, ids, metric).ok()).unwrap_or_default())
        }
    }
}

fn traces_beside(study: &Study) -> Option<TraceSet> {
    let folders: BTreeSet<&Path> = study.inputs.iter().filter_map(|input| input.path.parent()).collect();
    let inside = |folder: &Path| {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        inputs::resolve(&[folder.into()], std::io::empty()).unwrap_or_default()
    };
    let is_trace = |input: &Input| matches!(Source::open(slice::from_ref(input)), Ok(Source::Traces(_)));
    let traces: Vec<Input> = folders.into_iter().flat_map(inside).filter(is_trace).collect();
    TraceSet::open(&traces).ok().filter(|_| !traces.is_empty())
}

fn deciding_steps_in(
    study: &Study,
    traces: &TraceSet,
    ids: &BTreeSet<String>,
    metric: &str,
) -> Result<DecidingSteps, StudyError> {
    let mut definitions = study.question.bind(traces)?;
    definitions.select(&[metric.to_owned()])?;
    let evidence = evidence::explain_each(traces, &definitions, ids, study.threads)?.into_values();
    let first = evidence.filter_map(|found| Some((found.episode_id, found.metrics.into_iter().next()?)));
    Ok(first.map(|(id, found)| (id, (found.value, found.timesteps))).collect())
}

pub(crate) fn check_metric<'t>(table: &'t EpisodeTable, name: &str) -> Result<&'t Metric, UnknownMetric> {
    let found = table.catalog.metric.get(name).filter(|_| table.metric(name).is_some());
    let known = || table.metrics.iter().map(|column| column.name.clone()).collect::<Vec<_>>();
    found.ok_or_else(|| UnknownMetric::new(name, &known()))
}
