//! Compares two sides: definitions, scores or a report's folder. Gives the cells and episodes that differ, and the
//! timesteps that decided each difference.
//!
//! Rule: only metrics of both sides are scored, so a side may have others that these traces do not support.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use crate::inputs::{ScoreFile, Source, Stamp};
use crate::own_definitions::{NotScored, unscored};
use crate::question::Question;
use crate::{ErrorKind, Study, StudyError, scores};
use mirrorstats_analysis::changes::{Changes, Flip, Overlap};
use mirrorstats_metric::definitions::{Definitions, UnknownMetric};
use mirrorstats_report::layout::TableOrder;
use mirrorstats_report::style::Style;
use mirrorstats_score::cells::group::DEFAULT_BY;
use mirrorstats_score::error::ScoreError;
use mirrorstats_score::evidence::{self, Evidence};
use mirrorstats_score::score_traces;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::{flips, vocabulary};
use mirrorstats_trace::inputs::{self, Input};
use mirrorstats_trace::read::open::TraceSet;

/// One side of a comparison.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Side {
    /// Definitions by name or path.
    Definitions(PathBuf),
    /// Files of scores, as parts of one table.
    Scores(Vec<ScoreFile>),
}

/// The request for a comparison.
#[derive(Clone, Debug)]
pub struct DiffRequest {
    /// The metrics; all if absent.
    pub metrics: Option<Vec<String>>,
    /// A condition on episodes that applies to both sides; all episodes if absent.
    pub filter: Option<String>,
    /// The columns that cells are grouped by.
    pub by: Vec<String>,
    /// The definitions of scores that do not carry them; the default ones if absent.
    pub definitions_of_scores: Option<PathBuf>,
    pub threads: NonZeroUsize,
}

impl Default for DiffRequest {
    fn default() -> Self {
        Self {
            metrics: None,
            filter: None,
            by: DEFAULT_BY.map(str::to_owned).to_vec(),
            definitions_of_scores: None,
            threads: std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN),
        }
    }
}

/// The differences between two sides.
#[derive(Clone, Debug)]
pub struct Diff {
    /// Changed cells and episodes, in table order.
    pub changes: Changes,
    /// One sentence for each reason why deciding timesteps are unknown.
    pub notes: Vec<String>,
}

#[derive(Debug)]
pub(crate) struct Pair {
    pub before: Scored,
    pub after: Scored,
    /// The evidence for each difference, if one scan scored both sides.
    pub evidence: Option<[BTreeMap<String, Evidence>; 2]>,
}

#[derive(Debug)]
pub(crate) struct Scored {
    pub table: EpisodeTable,
    pub metrics: Vec<String>,
    /// The definitions; `None` for scores from a file, which carry their definitions as text.
    pub definitions: Option<Definitions>,
}

/// Compares two sides. `traces` are scored by definitions; if both sides are scores, they give the deciding timesteps.
pub fn diff(old: &Side, new: &Side, traces: &[Input], request: &DiffRequest) -> Result<Diff, StudyError> {
    let inputs = traces;
    let style = Style::load("default")?;
    let stamps = traces.iter().map(Stamp::of).collect::<Result<Vec<_>, _>>()?;
    let source = if traces.is_empty() { None } else { Some(Source::open(traces)?) };
    let traces = source.as_ref().map(Source::traces).transpose()?;
    let pair = Pair::score(old, new, traces, request)?;
    if pair.before.table.is_empty() && pair.after.table.is_empty() {
        new.study(inputs, request)?.check_filter(0)?;
    }
    let mut changes = pair.changes(&request.by, &style)?;
    let notes = match traces {
        Some(traces) => {
            let mut notes = pair.explain(&mut changes, traces, request.threads)?;
            notes.extend([&pair.before, &pair.after].into_iter().filter_map(|side| side.unscored(traces)));
            notes
        }
        None => Vec::new(),
    };
    stamps.iter().try_for_each(Stamp::check)?;
    Ok(Diff { changes, notes })
}

/// The changes from one study to another: cells, and episodes by their ids. Two studies of the same traces under one
/// filter are scored in one scan, which gives the timesteps that decided each difference. Other studies lack these
/// timesteps, and a note says so. Errors: as [`Study::score`] for either study; sums of squares beyond 128 bits.
pub fn diff_studies(before: &Study, after: &Study) -> Result<Diff, StudyError> {
    let by = before.question.by.clone().unwrap_or_else(|| DEFAULT_BY.map(str::to_owned).to_vec());
    if differ_in_definitions_alone(before, after) {
        let side = |study: &Study| Side::Definitions(study.question.definitions_name().to_owned());
        let (metrics, filter) = (before.question.metrics.clone(), before.question.filter.clone());
        let request = DiffRequest { metrics, filter, by, threads: before.threads, ..DiffRequest::default() };
        return diff(&side(before), &side(after), &before.inputs, &request);
    }
    let style = Style::load("default")?;
    let [mut before, mut after] = [before.score()?, after.score()?].map(|results| Scored::of(results.episodes, None));
    let common: Vec<String> = after.metrics.iter().filter(|name| before.metrics.contains(name)).cloned().collect();
    for side in [&mut before, &mut after] {
        side.table.metrics.retain(|metric| common.contains(&metric.name));
    }
    let changes = Pair { before, after, evidence: None }.changes(&by, &style)?;
    let why = "the two studies are not of the same traces under one filter";
    let note = (!changes.flips.is_empty()).then(|| format!("the timesteps that decided are not known: {why}"));
    Ok(Diff { changes, notes: note.into_iter().collect() })
}

fn differ_in_definitions_alone(one: &Study, other: &Study) -> bool {
    let question = |study: &Study| Question { definitions: None, ..study.question.clone() };
    let are_traces = [one, other].iter().all(|study| matches!(study.source, Source::Traces(_)));
    are_traces && one.stamps == other.stamps && question(one) == question(other)
}

impl Side {
    /// The side that an argument names. Errors: a folder or a Parquet file without scores.
    pub fn of(argument: impl AsRef<Path>) -> Result<Self, StudyError> {
        let path = argument.as_ref();
        let inside = path.join("episodes.parquet");
        let inputs = if inside.is_file() {
            vec![Input::new(inside)]
        } else if path.is_dir() {
            // A folder of parts, as a cluster writes it, is one table.
            inputs::resolve(&[path.as_os_str().to_owned()], io::empty())?
        } else {
            vec![Input::new(path)]
        };
        match ScoreFile::all(&inputs)? {
            Some(scores) => Ok(Self::Scores(scores)),
            None if path.is_dir() || (path.extension() == Some(OsStr::new("parquet")) && path.exists()) => {
                let argument = path.display();
                let words = format!(
                    "{argument}: expected definitions, scores or a report's folder, found no scores in it\n  \
                     help: OLD and NEW come first, the traces after them"
                );
                Err(StudyError::new(ErrorKind::Input, words))
            }
            None => Ok(Self::Definitions(path.to_owned())),
        }
    }

    fn question(&self, request: &DiffRequest) -> Question {
        let definitions = match self {
            Self::Definitions(name) => Some(name.clone()),
            Self::Scores(files) if files.iter().any(|file| file.carries_definitions) => None,
            Self::Scores(_) => request.definitions_of_scores.clone(),
        };
        Question {
            definitions,
            filter: request.filter.clone(),
            by: Some(request.by.clone()),
            pool: true,
            ..Question::default()
        }
    }

    fn study(&self, traces: &[Input], request: &DiffRequest) -> Result<Study, StudyError> {
        let inputs = match self {
            Self::Definitions(_) => traces.to_vec(),
            Self::Scores(files) => files.iter().map(|file| file.input.clone()).collect(),
        };
        Study::of(inputs)?.threads(request.threads).asked(self.question(request))
    }

    /// The names of its metrics; and the scores, unless definitions compute them.
    fn read(
        &self,
        traces: Option<&TraceSet>,
        request: &DiffRequest,
    ) -> Result<(Vec<String>, Option<EpisodeTable>), StudyError> {
        match self {
            Self::Definitions(name) => {
                let columns = traces.map_or_else(vocabulary::schema_columns, vocabulary::trace_columns);
                let definitions = Definitions::load(name, &columns)?;
                Ok((definitions.catalog.metric.keys().cloned().collect(), None))
            }
            Self::Scores(files) => {
                let table = scores::read(files, &Question { by: None, ..self.question(request) })?;
                Ok((table.metrics.iter().map(|metric| metric.name.clone()).collect(), Some(table)))
            }
        }
    }

    /// The definitions with these metrics, and the traces that they score; `None` for scores.
    fn bound<'t>(
        &self,
        metrics: &[String],
        traces: Option<&'t TraceSet>,
        request: &DiffRequest,
    ) -> Result<Option<(Definitions, &'t TraceSet)>, StudyError> {
        let Self::Definitions(name) = self else { return Ok(None) };
        let traces = traces.ok_or_else(|| {
            let words = "expected traces to score with them, found none\n  help: name the traces after OLD and NEW";
            StudyError::new(ErrorKind::Input, format!("`{}` are definitions: {words}", name.display()))
        })?;
        let question = Question { metrics: Some(metrics.to_vec()), ..self.question(request) };
        Ok(Some((question.bind(traces)?, traces)))
    }
}

impl Pair {
    fn score(old: &Side, new: &Side, traces: Option<&TraceSet>, request: &DiffRequest) -> Result<Self, StudyError> {
        let (old_metrics, old_table) = old.read(traces, request)?;
        let (new_metrics, new_table) = new.read(traces, request)?;
        check_known(request.metrics.as_deref(), &old_metrics, &new_metrics)?;
        let wanted = |name: &String| request.metrics.as_ref().is_none_or(|metrics| metrics.contains(name));
        let [before, after] =
            [old_metrics, new_metrics].map(|names| names.into_iter().filter(wanted).collect::<Vec<String>>());
        let common: Vec<String> = after.iter().filter(|name| before.contains(name)).cloned().collect();
        let (old, new) = (old.bound(&common, traces, request)?, new.bound(&common, traces, request)?);
        let labels = Question { by: Some(request.by.clone()), ..Question::default() }.labels();
        let scored = |bound: &Option<(Definitions, &TraceSet)>, scores: Option<EpisodeTable>| {
            if let Some((definitions, traces)) = bound {
                return score_traces::score(traces, definitions, &labels, request.threads);
            }
            let mut table = scores.expect("a side without definitions has scores");
            table.metrics.retain(|metric| common.contains(&metric.name));
            Ok(table)
        };
        let ([old_table, new_table], evidence) = match (&old, &new) {
            // One scan scores both.
            (Some((old, traces)), Some((new, _))) => {
                let pair = flips::score_pair(traces, [old, new], &labels, request.threads)?;
                (pair.tables, Some(pair.evidence))
            }
            _ => ([scored(&old, old_table)?, scored(&new, new_table)?], None),
        };
        let [old, new] = [old, new].map(|bound| bound.map(|(definitions, _)| definitions));
        Ok(Self {
            evidence,
            before: Scored { table: old_table, metrics: before, definitions: old },
            after: Scored { table: new_table, metrics: after, definitions: new },
        })
    }

    pub(crate) fn changes(&self, by: &[String], style: &Style) -> Result<Changes, StudyError> {
        let mut changes = Changes::between(&self.before.table, &self.after.table, by)?;
        changes.metrics = Overlap::of(&self.before.metrics, &self.after.metrics);
        TableOrder { catalog: &self.after.table.catalog, style }.sort(&mut changes);
        Ok(changes)
    }

    /// Adds the timesteps that decided each flip; returns a note for each reason why some are unknown.
    pub(crate) fn explain(
        &self,
        changes: &mut Changes,
        traces: &TraceSet,
        threads: NonZeroUsize,
    ) -> Result<Vec<String>, StudyError> {
        if let Some([before, after]) = &self.evidence {
            changes.explain(before, after);
            return Ok(Vec::new());
        }
        let wanted = changes.flipped_episodes();
        let mut notes = Vec::new();
        if wanted.is_empty() {
            return Ok(notes);
        }
        let metrics = changes.flipped_metrics();
        let mut evidence = |side: &Scored, word| match side.definitions(traces, &metrics) {
            Ok(definitions) => Ok(evidence::explain_each(traces, &definitions, &wanted, threads)?),
            Err(error @ (ScoreError::Carried(_) | ScoreError::Column { .. })) => {
                notes.push(format!("the timesteps that decided {word} are not known: {error}"));
                Ok(BTreeMap::new())
            }
            Err(error) => Err(StudyError::from(error)),
        };
        let (before, after) = (evidence(&self.before, "before")?, evidence(&self.after, "after")?);
        changes.explain(&before, &after);
        if notes.is_empty() {
            notes.extend(unexplained(changes));
        }
        Ok(notes)
    }
}

impl Scored {
    pub(crate) fn of(table: EpisodeTable, definitions: Option<Definitions>) -> Self {
        let metrics = table.metrics.iter().map(|metric| metric.name.clone()).collect();
        Self { table, metrics, definitions }
    }

    fn unscored(&self, traces: &TraceSet) -> Option<String> {
        let is_kept = |name: &str| self.table.keys.iter().any(|key| key.experiment == name);
        let NotScored { experiment, definitions, own } = unscored(self.definitions.as_ref()?, traces, is_kept)?;
        Some(format!(
            "`{definitions}` does not score the experiment `{experiment}`, as `{own}` does: its zeros there mean nothing"
        ))
    }

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

fn check_known(asked: Option<&[String]>, old: &[String], new: &[String]) -> Result<(), UnknownMetric> {
    let known = || new.iter().chain(old.iter().filter(|name| !new.contains(name)));
    match asked.unwrap_or_default().iter().find(|name| !known().any(|known| known == *name)) {
        None => Ok(()),
        Some(name) => Err(UnknownMetric::new(name, &known().cloned().collect::<Vec<_>>())),
    }
}

fn unexplained(changes: &Changes) -> Option<String> {
    let lacks = |flip: &&Flip| flip.timesteps.before.is_none() || flip.timesteps.after.is_none();
    let count = changes.flips.iter().filter(lacks).count();
    (count > 0).then(|| {
        let all = changes.flips.len();
        format!("{count} of {all} flips are not explained: the traces lack their episodes, or give other scores")
    })
}
