//! The study under other thresholds of mirror evidence: how each cell moves, and which conclusions change.
//!
//! Rule: all thresholds and the unchanged definitions share one scan and one plan. A threshold replaces the `let`
//! `visible` of the definitions by `mirror_self_px >= K`, as an edited definition file would; it applies to a filter
//! too.

use std::collections::BTreeSet;
use std::str::FromStr;

use crate::losses::{self, Counted};
use crate::question::Question;
use crate::results::Results;
use crate::scan::score_with_losses;
use crate::statistics::statistics;
use crate::{ErrorKind, Study, StudyError, own_definitions};
use mirrorstats_analysis::statistics::Options;
use mirrorstats_metric::columns::Columns;
use mirrorstats_metric::definitions::{Definitions, ReplaceError};
use mirrorstats_report::sensitivity::{Level, Reference, Sensitivity};
use mirrorstats_report::style::Style;
use mirrorstats_score::physical::PhysicalPlan;
use mirrorstats_score::score_traces::{self, Outputs, Scored};
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::vocabulary;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::schema::domain::Domain;

/// The column that a threshold applies to.
const PIXELS: &str = "mirror_self_px";
/// Counts the steps of an episode without a value in it.
const MISSING_PIXELS: &str = include_str!("../../../assets/scan/missing_pixels.toml");
const EVIDENCE: &str = "visible";
/// The column that records evidence as ground truth.
const GROUND_TRUTH: &str = "mirror_visible";
const THRESHOLD_KEY: &str = "visibility_threshold_px";

/// The default thresholds, px.
pub const DEFAULT_THRESHOLDS: &str = "1,10,30,60,120,240";

/// Thresholds, ascending and distinct, px.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Thresholds(Vec<u32>);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected whole numbers of pixels from 1 on, separated by commas, such as {DEFAULT_THRESHOLDS}, found `{found}`"
)]
pub struct ThresholdsError {
    found: String,
}

impl FromStr for Thresholds {
    type Err = ThresholdsError;

    fn from_str(text: &str) -> Result<Self, ThresholdsError> {
        // Zero pixels are no evidence; no value of the column, a signed 32-bit integer, reaches a larger threshold.
        let one = |text: &str| text.trim().parse::<u32>().ok().filter(|px| (1..=i32::MAX as u32).contains(px));
        let all: Option<BTreeSet<u32>> = text.split(',').map(one).collect();
        all.map(|all| Self(all.into_iter().collect())).ok_or_else(|| ThresholdsError { found: text.to_owned() })
    }
}

#[derive(Debug)]
pub struct SensitivityReport {
    pub found: Sensitivity,
    pub notes: Vec<String>,
}

/// Scores a study under each threshold of mirror evidence and under the unchanged definitions, in one scan. Errors: as
/// [`statistics`]; scores, or traces that do not record `mirror_self_px` at every step; definitions without a `let`
/// named `visible` that is true or false at each step; metrics that do not depend on it.
pub fn sensitivity(study: &Study, thresholds: &Thresholds) -> Result<SensitivityReport, StudyError> {
    let traces = study.traces()?;
    check_pixels(traces)?;
    let style = Style::load("default")?;
    let trial = Trial::of(&study.question, traces, thresholds)?;
    let scored = scan(study, &trial, traces);
    study.check_unchanged()?;
    let (tables, lost) = scored?;
    let stages = stages(study, &trial, tables, lost.as_ref())?;
    let lost = stages.first().map_or(0, |(_, lost)| *lost);
    let levels: Vec<Level> = stages.into_iter().map(|(level, _)| level).collect();
    let found = Sensitivity::from_levels(&levels, &trial.reference, &trial.moved, &trial.unmoved, &style);
    Ok(SensitivityReport { found, notes: trial.notes(lost) })
}

/// A table for each threshold after the one of the unchanged definitions, then one of the steps without pixels; and the
/// lost episodes.
fn scan(
    study: &Study,
    trial: &Trial,
    traces: &TraceSet,
) -> Result<(Vec<EpisodeTable>, Option<BTreeSet<String>>), StudyError> {
    let labels = study.question.labels_over(traces);
    let outputs = Outputs { labels: &labels, ..Outputs::default() };
    let all: Vec<&Definitions> = trial.definitions.iter().chain([&trial.pixels]).collect();
    let (Scored { tables, .. }, lost) = score_with_losses(traces, &all, outputs, study.threads)?;
    own_definitions::check_scored(&trial.definitions[0], traces, &tables[0])?;
    Ok((tables, lost))
}

/// The results of each threshold, with the number of lost episodes.
fn stages(
    study: &Study,
    trial: &Trial,
    mut tables: Vec<EpisodeTable>,
    lost: Option<&BTreeSet<String>>,
) -> Result<Vec<(Level, u64)>, StudyError> {
    let pixels = tables.pop().expect("a table per definitions");
    study.check_filter(tables.iter().map(EpisodeTable::len).max().unwrap_or(0))?;
    let counted = |table| {
        let mut results = Results { lost: lost.cloned(), ..Results::of(table) };
        study.declare(&mut results)?;
        Ok(Counted::of(results, study.question.lost))
    };
    let counted: Vec<Counted> = tables.into_iter().map(counted).collect::<Result<_, StudyError>>()?;
    check_values(&pixels, counted.iter().map(|counted| &counted.results.episodes))?;
    let px = [None].into_iter().chain(trial.thresholds.iter().copied().map(Some));
    px.zip(counted).map(|(px, counted)| stage(study, px, counted)).collect()
}

fn stage(study: &Study, px: Option<u32>, counted: Counted) -> Result<(Level, u64), StudyError> {
    let mut grouped = study.group(counted)?;
    let cells = grouped.cells.clone();
    // Conclusions need no intervals of cells; their bootstraps would take most of the time.
    grouped.cells.metrics.clear();
    grouped.cells.groups.iter_mut().for_each(|group| group.moments.clear());
    let statistics = statistics(&grouped, &Options::default())?;
    Ok((Level { px, cells, statistics }, grouped.counted.lost.total()))
}

struct Trial {
    thresholds: Vec<u32>,
    definitions: Vec<Definitions>,
    pixels: Definitions,
    reference: Reference,
    moved: Vec<String>,
    unmoved: Vec<String>,
    is_filter_moved: bool,
}

impl Trial {
    fn of(question: &Question, traces: &TraceSet, thresholds: &Thresholds) -> Result<Self, StudyError> {
        let columns = vocabulary::trace_columns(traces);
        let as_is = question.bind(traces)?;
        let bound = |px: u32| under(question, px, &columns);
        let (dependent, is_filter_moved) = dependent(&bound(1)?, &bound(2)?);
        let metrics = as_is.plan.outputs.iter().map(|output| output.name.clone());
        let (moved, unmoved): (Vec<String>, Vec<String>) = metrics.partition(|name| dependent.contains(name));
        if moved.is_empty() {
            let metrics = unmoved.join(", ");
            let words = format!(
                "expected a metric that depends on the `let` `{EVIDENCE}`, found none among {metrics}\n  \
                 help: ask for other metrics with --metrics, or let the definitions use `{EVIDENCE}`"
            );
            return Err(StudyError::new(ErrorKind::Argument, words));
        }
        let mut definitions = vec![as_is];
        for px in &thresholds.0 {
            definitions.push(score_traces::checked(traces, bound(*px)?)?);
        }
        let is_recorded = definitions[0].catalog.lets.get(EVIDENCE).is_some_and(|text| text.trim() == GROUND_TRUTH);
        Ok(Self {
            thresholds: thresholds.0.clone(),
            definitions,
            pixels: Definitions::from_toml("missing_pixels", MISSING_PIXELS, &columns)?,
            reference: Reference { is_recorded, px: recorded_px(traces) },
            moved,
            unmoved,
            is_filter_moved,
        })
    }

    fn notes(&self, lost: u64) -> Vec<String> {
        let mut notes = Vec::new();
        if self.is_filter_moved {
            notes.push(format!("the filter depends on `{EVIDENCE}`: each threshold keeps its own episodes"));
        }
        if lost > 0 {
            notes.push(format!("{}: in no denominator", losses::lost_episodes(lost)));
        }
        notes
    }
}

/// The requested definitions, with evidence from this number of pixels on.
fn under(question: &Question, px: u32, columns: &Columns) -> Result<Definitions, StudyError> {
    let as_is = question.load(columns)?;
    let shown = format!("the threshold of {px} px");
    let replaced = as_is.with_condition_let(EVIDENCE, &shown, &format!("{PIXELS} >= {px}"), columns);
    let definitions = replaced.map_err(|source| match source {
        ReplaceError::Faults(faults) => StudyError::from(faults),
        other => refused(&format!("{}: {other}", question.definitions_name().display())),
    })?;
    question.applied(definitions, columns)
}

/// The metrics that depend on the evidence, and whether the filter does: two definitions differ only in it.
fn dependent(one: &Definitions, other: &Definitions) -> (BTreeSet<String>, bool) {
    let plan = PhysicalPlan::of(&[&one.plan, &other.plan]);
    let [one, other] = plan.scores.as_slice() else { unreachable!("the plan has two sets of definitions") };
    let pairs = one.metrics.iter().zip(&other.metrics);
    let metrics = pairs.filter(|(one, other)| one.step != other.step).map(|(one, _)| one.name.clone());
    (metrics.collect(), one.filter != other.filter)
}

fn recorded_px(traces: &TraceSet) -> Vec<u64> {
    let px: BTreeSet<u64> = traces.files().iter().filter_map(|file| file.recording()[THRESHOLD_KEY].as_u64()).collect();
    px.into_iter().collect()
}

fn refused(words: &str) -> StudyError {
    StudyError::new(ErrorKind::Input, words)
}

fn check_pixels(traces: &TraceSet) -> Result<(), StudyError> {
    if traces.domain() == Domain::Own {
        return Err(refused(
            "expected traces of the domain `mirror`, whose thresholds of evidence vary here; found another domain\n  \
             help: write the other threshold into a definition file, and compare it with `mirrorstats diff`",
        ));
    }
    let problem = match traces.column(PIXELS) {
        None => "no trace has it".to_owned(),
        Some(found) => match (found.conflict, found.missing_from) {
            (Some([(first, a), (second, b)]), _) => {
                format!("it is {} in `{first}` and {} in `{second}`", a.name(), b.name())
            }
            (None, Some(file)) => format!("`{file}` has no such column"),
            (None, None) => return Ok(()),
        },
    };
    let help =
        "give traces that record it, as those of `mirrorstats record` do; `mirrorstats trace info` lists the columns";
    Err(refused(&format!(
        "expected traces with the column `{PIXELS}`, to which a threshold applies: {problem}\n  help: {help}"
    )))
}

/// Checks that every step of the counted episodes has a value; `pixels` counts the steps without one.
fn check_values<'t>(pixels: &EpisodeTable, counted: impl Iterator<Item = &'t EpisodeTable>) -> Result<(), StudyError> {
    let ids: BTreeSet<&str> = counted.flat_map(|table| table.keys.iter().map(|key| key.episode_id)).collect();
    let missing = pixels.metrics.iter().flat_map(|metric| pixels.keys.iter().zip(metric.iter()));
    let missing: Vec<(&str, i64)> = missing
        .filter_map(|(key, count)| Some((key.episode_id, count.filter(|count| *count > 0)?)))
        .filter(|(id, _)| ids.contains(id))
        .collect();
    let Some((episode, _)) = missing.first() else { return Ok(()) };
    let steps: i64 = missing.iter().map(|(_, count)| count).sum();
    let (without, all) = (missing.len(), ids.len());
    Err(refused(&format!(
        "{PIXELS}: expected a value at every step, found {steps} in {without} of {all} episodes without one, for example in \
         `{episode}`: a threshold does not say what they show\n  \
         help: --where \"all({PIXELS} is not null)\" keeps the episodes that have them"
    )))
}

#[cfg(test)]
mod tests {
    use super::{DEFAULT_THRESHOLDS, Thresholds};

    #[test]
    fn thresholds_ascend_and_are_whole_numbers_of_pixels() {
        assert_eq!("60, 1,60,10".parse(), Ok(Thresholds(vec![1, 10, 60])));
        assert_eq!(DEFAULT_THRESHOLDS.parse(), Ok(Thresholds(vec![1, 10, 30, 60, 120, 240])));
        for text in ["", "0", "1,,2", "-1", "1.5", "60px", "2147483648"] {
            assert!(text.parse::<Thresholds>().is_err(), "{text}");
        }
    }
}
