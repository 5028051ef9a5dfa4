//! The two sides of a comparison: what was typed (definitions, scores, a report) to episode tables, and to the
//! timesteps that decided where they differ.
//!
//! Rule: only metrics that both sides have are scored, so that a side may have others that these traces do not bear.

use std::collections::BTreeMap;
use std::io;
use std::num::NonZeroUsize;
use std::path::Path;

use super::args::ScoringArgs;
use super::outcome::Failure;
use super::{empty_filter, scoring};
use crate::base::near::nearest;
use crate::cells::changes::{Changes, Flip, Overlap};
use crate::metric::definitions::{Definitions, UnknownMetric};
use crate::score::evidence;
use crate::score::score_traces::{self, ScoreError};
use crate::score::table::EpisodeTable;
use crate::trace::inputs::{self, Input};
use crate::trace::open::TraceSet;

/// What stands on one side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Side {
    /// Definitions by name or path.
    Definitions(String),
    /// Files of scores, the parts of one table.
    Scores(Vec<Input>),
}

/// What to compare of the two.
#[derive(Clone, Copy, Debug)]
pub struct Asked<'a> {
    /// The metrics; all if absent.
    pub metrics: Option<&'a [String]>,
    /// The episodes; all if absent.
    pub condition: Option<&'a str>,
    /// The columns that cells are grouped by.
    pub by: &'a [String],
    /// The definitions of scores that do not carry them.
    pub text_definitions: Option<&'a str>,
    /// How many threads to use.
    pub threads: NonZeroUsize,
}

/// Both sides, scored.
#[derive(Debug)]
pub struct Sides {
    /// The old one.
    pub before: Scored,
    /// The new one.
    pub after: Scored,
}

/// One side, scored.
#[derive(Debug)]
pub struct Scored {
    /// Its episodes, under the metrics that both sides have.
    pub table: EpisodeTable,
    /// All its metrics among those asked for.
    pub metrics: Vec<String>,
    /// What scored it; `None` for scores that were read, which carry their definitions as text.
    pub definitions: Option<Definitions>,
}

impl Side {
    /// What an argument names.
    ///
    /// # Errors
    /// A folder or a Parquet file that holds no scores.
    pub fn of(argument: &str) -> Result<Self, Failure> {
        let path = Path::new(argument);
        let inside = path.join("episodes.parquet");
        if inside.is_file() {
            return Ok(Self::Scores(vec![Input::new(inside)]));
        }
        // A folder of parts, as a cluster writes them, is one table.
        let inputs = if path.is_dir() { folder(argument)? } else { vec![Input::new(argument)] };
        if scoring::are_scores(&inputs) {
            return Ok(Self::Scores(inputs));
        }
        if path.is_dir() || (argument.ends_with(".parquet") && path.exists()) {
            return Err(Failure::Rendered(format!(
                "error: {argument}: expected definitions, scores or a report's folder, found no scores in it\n  help: OLD and NEW come first, the traces after them"
            )));
        }
        Ok(Self::Definitions(argument.to_owned()))
    }

    /// The definitions that it names, if it is no scores.
    pub fn definitions(&self) -> Option<&str> {
        match self {
            Self::Definitions(name) => Some(name),
            Self::Scores(_) => None,
        }
    }

    /// How it is scored, or how its scores are read.
    fn scoring(&self, asked: &Asked) -> ScoringArgs {
        let definitions = match self {
            Self::Definitions(name) => Some(name.as_str()),
            Self::Scores(inputs) if inputs.iter().any(scoring::carries_definitions) => None,
            Self::Scores(_) => asked.text_definitions,
        };
        let condition = asked.condition.map(str::to_owned);
        ScoringArgs { definitions: definitions.map(str::to_owned), metrics: None, condition }
    }

    /// Refuses no episodes where the filter is why there are none.
    ///
    /// # Errors
    /// Such a filter; what is wrong with the traces or scores without it.
    pub fn check_filter(&self, traces: &[Input], asked: &Asked) -> Result<(), Failure> {
        let inputs = if let Self::Scores(inputs) = self { inputs } else { traces };
        empty_filter::check(0, inputs, &self.scoring(asked), asked.threads)
    }

    /// Its metrics, and its scores if it is scores.
    fn read(&self, traces: Option<&TraceSet>, asked: &Asked) -> Result<(Vec<String>, Option<EpisodeTable>), Failure> {
        match self {
            Self::Definitions(name) => {
                let columns = traces.map_or_else(score_traces::schema_columns, score_traces::trace_columns);
                let definitions = Definitions::load(name, &columns).map_err(scoring::definition_failure)?;
                Ok((definitions.catalog.metric.keys().cloned().collect(), None))
            }
            Self::Scores(inputs) => {
                let table = scoring::table(inputs, &self.scoring(asked), &[], asked.threads)?;
                Ok((table.metrics.iter().map(|metric| metric.name.clone()).collect(), Some(table)))
            }
        }
    }

    /// The episodes under the metrics `common`, and what scored them now.
    fn score(
        &self,
        read: Option<EpisodeTable>,
        common: &[String],
        traces: Option<&TraceSet>,
        asked: &Asked,
    ) -> Result<(EpisodeTable, Option<Definitions>), Failure> {
        match (self, read, traces) {
            (Self::Definitions(_), _, Some(traces)) => {
                let scoring = ScoringArgs { metrics: Some(common.to_vec()), ..self.scoring(asked) };
                let definitions = scoring::definitions(traces, &scoring)?;
                let labels = scoring::labels(asked.by);
                let table = score_traces::score(traces, &definitions, &labels, asked.threads)
                    .map_err(scoring::score_failure)?;
                Ok((table, Some(definitions)))
            }
            (_, Some(mut table), _) => {
                table.metrics.retain(|metric| common.contains(&metric.name));
                Ok((table, None))
            }
            (Self::Definitions(name), None, None) => Err(no_traces(name)),
            (Self::Scores(_), None, _) => unreachable!("scores are read before"),
        }
    }
}

/// The files of a folder.
fn folder(argument: &str) -> Result<Vec<Input>, Failure> {
    inputs::resolve(&[argument.to_owned()], io::empty()).map_err(Failure::input)
}

/// Definitions alone score nothing.
fn no_traces(name: &str) -> Failure {
    Failure::Rendered(format!(
        "error: `{name}` are definitions: expected traces to score with them, found none\n  help: name the traces after OLD and NEW"
    ))
}

/// Scores both sides.
///
/// # Errors
/// What is wrong with definitions, scores or traces; a metric that neither side has.
pub fn pair(old: &Side, new: &Side, traces: Option<&TraceSet>, asked: &Asked) -> Result<Sides, Failure> {
    let (old_metrics, old_table) = old.read(traces, asked)?;
    let (new_metrics, new_table) = new.read(traces, asked)?;
    check_known(asked.metrics, &old_metrics, &new_metrics)?;
    let wanted = |name: &String| asked.metrics.is_none_or(|metrics| metrics.contains(name));
    let [before, after] =
        [old_metrics, new_metrics].map(|names| names.into_iter().filter(wanted).collect::<Vec<String>>());
    let common: Vec<String> = after.iter().filter(|name| before.contains(name)).cloned().collect();
    let scored = |side: &Side, read, metrics| {
        let (table, definitions) = side.score(read, &common, traces, asked)?;
        Ok::<_, Failure>(Scored { table, metrics, definitions })
    };
    Ok(Sides { before: scored(old, old_table, before)?, after: scored(new, new_table, after)? })
}

/// Every metric asked for is one of some side.
fn check_known(asked: Option<&[String]>, old: &[String], new: &[String]) -> Result<(), Failure> {
    let known = || new.iter().chain(old.iter().filter(|name| !new.contains(name)));
    match asked.unwrap_or_default().iter().find(|name| !known().any(|known| known == *name)) {
        None => Ok(()),
        Some(name) => {
            let near = nearest(name, known().map(String::as_str)).map(str::to_owned);
            Err(Failure::input(UnknownMetric { name: name.clone(), near, known: known().cloned().collect() }))
        }
    }
}

/// What changed between the sides, its metrics those asked for.
///
/// # Errors
/// Columns to group by that a side does not have; sums that leave 128 bits.
pub fn changes(sides: &Sides, by: &[String]) -> Result<Changes, Failure> {
    let mut changes = Changes::of(&sides.before.table, &sides.after.table, by).map_err(Failure::input)?;
    changes.metrics = Overlap::of(&sides.before.metrics, &sides.after.metrics);
    Ok(changes)
}

/// Adds the timesteps that decided each flip; returns what there is to say about those that are not known.
///
/// # Errors
/// What is wrong with the rows of the traces.
pub fn explain(
    changes: &mut Changes,
    traces: &TraceSet,
    sides: &Sides,
    threads: NonZeroUsize,
) -> Result<Vec<String>, Failure> {
    let wanted = changes.flipped_episodes();
    let mut notes = Vec::new();
    if wanted.is_empty() {
        return Ok(notes);
    }
    let metrics = changes.flipped_metrics();
    let mut evidence = |side: &Scored, word| match side.definitions(traces, &metrics) {
        Ok(definitions) => {
            evidence::explain_each(traces, &definitions, &wanted, threads).map_err(scoring::score_failure)
        }
        Err(error @ (ScoreError::Carried(_) | ScoreError::Column { .. })) => {
            notes.push(format!("the timesteps that decided {word} are not known: {error}"));
            Ok(BTreeMap::new())
        }
        Err(error) => Err(scoring::score_failure(error)),
    };
    let (before, after) = (evidence(&sides.before, "before")?, evidence(&sides.after, "after")?);
    changes.explain_before(&before);
    changes.explain_after(&after);
    if notes.is_empty() {
        notes.extend(unexplained(changes));
    }
    Ok(notes)
}

/// What there is to say where some flips have no timesteps.
fn unexplained(changes: &Changes) -> Option<String> {
    let lacks = |flip: &&Flip| flip.timesteps.before.is_none() || flip.timesteps.after.is_none();
    let count = changes.flips.iter().filter(lacks).count();
    (count > 0).then(|| {
        let all = changes.flips.len();
        format!("{count} of {all} flips are not explained: the traces lack their episodes, or give other scores")
    })
}

impl Scored {
    /// These metrics of what scored it, read back from what its scores carry if they were not computed now.
    fn definitions(&self, traces: &TraceSet, metrics: &[String]) -> Result<Definitions, ScoreError> {
        match &self.definitions {
            None => score_traces::restored(traces, &self.table.catalog, metrics),
            Some(definitions) => {
                let mut definitions = definitions.clone();
                definitions.select(metrics)?;
                Ok(definitions)
            }
        }
    }
}
