//! A study: inputs, definitions and a filter, opened and scanned once; every answer is a function of it.
//!
//! ```text
//! Study::open ──► definitions, filter, metrics, by ──► scan ──► episodes, timelines, losses, input hashes
//!                                                              │
//!                            score, cells, report, figures, statistics, diff, rescore, compare
//! ```
//!
//! ```
//! # let paper = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/paper");
//! let study = mirrorstats_study::Study::open([paper])?.filter("experiment = 'E1'")?;
//! assert_eq!(study.score()?.episodes.len(), 168);
//! # Ok::<(), mirrorstats_study::StudyError>(())
//! ```
//!
//! Rule: each input is opened once, and must stay the same until the answer is complete; a file that changes is an
//! error. Nothing here depends on a command line: text for people comes from errors and from `report`.

#![warn(clippy::print_stdout, clippy::print_stderr)]

mod backend;
mod compare;
mod copies;
mod definitions;
mod error;
mod losses;
mod output;
#[cfg(feature = "polars")]
mod query;
mod read;

pub use output::verify;
use output::{agreement, audit, figure_inputs, overview, provenance, quality_check, report};

use compare::{diff, gate, pooled, sensitivity};

use definitions::{own_definitions, question, rescore};

use read::{experiment_findings, findings, import, inputs, results, scan, scores};

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use mirrorstats_exact::replace;
use mirrorstats_metric::definitions::Definitions;
use mirrorstats_metric::file;
use mirrorstats_report::bundle::BundleError;
use mirrorstats_report::cells::Cells;
use mirrorstats_report::cells::group::group;
use mirrorstats_report::comparison::{PublishedComparison, choose, compare};
use mirrorstats_report::errata::Errata;
use mirrorstats_report::figures::{Figure, FigureName};
pub use mirrorstats_report::layout;
use mirrorstats_report::layout::MetricTable;
use mirrorstats_report::plan::departures::{Looks, departures};
use mirrorstats_report::plan::register::RegisteredPlan;
use mirrorstats_report::published;
use mirrorstats_report::statistics::{Options, Ranks, Replies};
use mirrorstats_report::style::{EmphasisRule, Style};
use mirrorstats_report::tables::ListTable;
use mirrorstats_score::evidence::{self, Evidence};
use mirrorstats_score::tables::lost_counts::LostCounts;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::{score_traces, vocabulary};
use mirrorstats_trace::footers::checksums::stale_note;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::read::steps::Steps;

pub use agreement::{CoderCount, LabelAgreement, LabelCount, PairAgreement};
pub use audit::audit_tables;
pub use backend::{SparkJob, are_uris};
pub use diff::{Diff, DiffRequest, Side, diff};
pub use error::StudyError;
use figure_inputs::{Drawings, FigureInputs};
pub use figure_inputs::{FigureOptions, MANY_MODELS};
pub use findings::{findings, findings_text};
pub use import::{ImportAnswer, ImportRequest, OwnColumn, import};
pub use inputs::{ScoreFile, Source, resolve};
pub use losses::LostAs;
pub use overview::{Overview, Part};
pub use own_definitions::ScoredAlike;
pub use provenance::ProvenanceError;
pub use quality_check::{CellAnswer, NotRecorded, QualityCheckAnswer, QualityLimits, Violation};
use question::DEFAULT_DEFINITIONS;
pub use question::Question;
pub use report::{Report, ReportOptions, WrittenReport};
pub use rescore::{RescoreRequest, Rescored, folder_of_rescored, traces_of};
pub use results::{ModelMean, Outputs, Results, model_means};
pub use scores::write as write_scores;
pub use sensitivity::{DEFAULT_THRESHOLDS, SensitivityReport, Thresholds, ThresholdsError};

use inputs::{Stamp, labelled};
use output::statistics::{check_comparisons, design_of};

/// Open inputs, and the question about them.
#[derive(Debug)]
pub struct Study {
    inputs: Vec<Input>,
    /// The state of each input before it was opened.
    stamps: Vec<Stamp>,
    source: Source,
    question: Question,
    threads: NonZeroUsize,
    plan: Option<RegisteredPlan>,
}

impl Study {
    /// Opens traces, files of scores or folders of either: paths, folders, globs. Errors: an argument that names no
    /// file, the first fault of a footer, traces and scores mixed.
    pub fn open<T: Into<OsString>>(arguments: impl IntoIterator<Item = T>) -> Result<Self, StudyError> {
        let arguments: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
        Self::of(resolve(&arguments, std::io::empty())?)
    }

    /// Opens these files. Errors: the first fault of a footer, traces and scores mixed, no file at all.
    pub fn of(inputs: Vec<Input>) -> Result<Self, StudyError> {
        let stamps = inputs.iter().map(Stamp::of).collect::<Result<_, _>>()?;
        let source = Source::open(&inputs)?;
        let threads = std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let mut question = Question::default();
        if let Source::Traces(traces) = &source {
            // Problems with definitions are reported with the answer: the caller may set others first.
            question = question.clone().resolved(traces).unwrap_or(question);
        }
        Ok(Self { inputs, stamps, source, question, threads, plan: None })
    }

    /// Sets the definitions: `paper`, `extended`, or the path of a TOML file. Errors: a file that cannot be read; every
    /// fault in it.
    pub fn definitions(mut self, name: impl Into<PathBuf>) -> Result<Self, StudyError> {
        self.question.definitions = Some(name.into());
        self.checked()
    }

    /// Keeps the episodes that satisfy a condition in the language of definitions, such as `seed = 1 and TSA = 1`.
    /// Errors: every fault of the condition.
    pub fn filter(mut self, condition: &str) -> Result<Self, StudyError> {
        self.question.filter = Some(condition.to_owned());
        self.checked()
    }

    /// Computes only these metrics. Errors: a metric that the definitions lack.
    pub fn metrics<T: Into<String>>(mut self, names: impl IntoIterator<Item = T>) -> Result<Self, StudyError> {
        self.question.metrics = Some(names.into_iter().map(Into::into).collect());
        self.checked()
    }

    /// Groups cells by these columns. The default is experiment and model, and the condition if there are several. A
    /// column that no episode has is an error of the scan.
    #[must_use]
    pub fn by<T: Into<String>>(mut self, columns: impl IntoIterator<Item = T>) -> Self {
        self.question.by = Some(columns.into_iter().map(Into::into).collect());
        self
    }

    /// Allows a cell to mix episodes recorded differently: in other worlds, with other prompts, by other agents.
    #[must_use]
    pub const fn pool(mut self) -> Self {
        self.question.pool = true;
        self
    }

    /// Compares the analysis with this plan: each answer lists the departures.
    #[must_use]
    pub fn registered(mut self, plan: RegisteredPlan) -> Self {
        self.plan = Some(plan);
        self
    }

    /// The departures from the registered plan; `None` without a plan.
    fn departures(&self, episodes: &EpisodeTable, options: &Options, looks: Looks) -> Option<Vec<String>> {
        Some(departures(self.plan.as_ref()?, episodes, options, looks))
    }

    /// Sets the number of threads; the default is all cores. Results do not depend on it.
    #[must_use]
    pub const fn threads(mut self, threads: NonZeroUsize) -> Self {
        self.threads = threads;
        self
    }

    /// Sets a whole question at once. Errors: every fault of the definitions and the condition; a metric that the
    /// definitions lack.
    pub fn asked(mut self, question: Question) -> Result<Self, StudyError> {
        self.question = question;
        self.checked()
    }

    /// Checks a definition file and a filter before any row is read. The scan checks that the traces have the columns,
    /// when the requested metrics are known.
    fn checked(mut self) -> Result<Self, StudyError> {
        if let Source::Traces(traces) = &self.source {
            self.question = self.question.resolved(traces)?;
            self.question.bind_to(&vocabulary::trace_columns(traces))?;
        }
        Ok(self)
    }

    /// The traces, for an answer that needs steps. Errors: scores, which have no steps.
    pub fn traces(&self) -> Result<&TraceSet, StudyError> {
        self.source.traces()
    }

    /// The steps of the episodes that the filter keeps, with these columns in this order; all columns if absent.
    /// Errors: scores, which have no steps; a column that no trace has, or that traces have with different types; with
    /// a filter, as [`Study::score`].
    pub fn steps(&self, columns: Option<&[String]>) -> Result<Steps, StudyError> {
        let traces = self.source.traces()?;
        if self.question.filter.is_none() {
            return Ok(Steps::new(traces, columns, None, self.threads)?);
        }
        let kept = self.score()?.episodes.keys.iter().map(|key| key.episode_id.to_owned()).collect();
        Ok(Steps::new(traces, columns, Some(kept), self.threads)?)
    }

    /// The episode table. Errors: faults of the traces or the scores; numbers beyond 64 bits.
    pub fn score(&self) -> Result<Results, StudyError> {
        self.scan(Outputs { losses: true, ..Outputs::default() })
    }

    /// The cells: exact moments of every metric in every group. Errors: as [`Study::score`]; a column to group by that
    /// the episodes lack.
    pub fn cells(&self) -> Result<Cells, StudyError> {
        let counted = self.counted(self.score()?);
        self.cells_of(&counted.results.episodes)
    }

    /// The cells of these episodes, as [`Study::cells`]. Errors: a column to group by that the episodes lack; a cell
    /// that mixes episodes recorded differently.
    pub(crate) fn cells_of(&self, episodes: &EpisodeTable) -> Result<Cells, StudyError> {
        let by = self.question.by_over(episodes);
        if !self.question.pool {
            pooled::check(episodes, &by)?;
        }
        check_comparisons(episodes)?;
        Ok(group(episodes, &by)?)
    }

    fn tables(
        &self,
        episodes: &EpisodeTable,
        (lost, replies): (&LostCounts, Option<&Replies>),
        cells: &Cells,
        style: &Style,
    ) -> Result<(Vec<MetricTable>, Option<ListTable>), StudyError> {
        let (mut tables, mut ranks) = (layout::tables(cells, style)?, None);
        if tables.iter().any(|table| table.is_tied) {
            let design = design_of(&episodes.declared);
            let found = Ranks::of_table(episodes, &self.undecided(lost), design, self.question.pool)?;
            for table in &mut tables {
                table.mark_ties(&found, style.sheet.emphasis_note(EmphasisRule::Tied));
            }
            ranks = found.list();
        }
        let chosen = self.selection(episodes).map(|selection| selection.sentence());
        let pooled = self.pooled(episodes)?.unwrap_or_default();
        let left_out = losses::beside_cells(&self.undecided(lost), replies);
        for table in &mut tables {
            table.footnotes.extend(chosen.iter().chain(&pooled).chain(&left_out).cloned());
        }
        Ok((tables, ranks))
    }

    /// A sentence about traces whose checksums belong to another version of the file.
    pub fn stale_checksums(&self) -> Option<String> {
        self.source.traces().ok().and_then(|traces| stale_note(traces.files()))
    }

    /// One figure, with the models in the order of a style. Errors: as [`Study::score`]; inputs that lack data for the
    /// figure; a wrong number of metrics; a width that its text does not fit in at 6 pt.
    pub fn figure(&self, name: FigureName, options: &FigureOptions) -> Result<Figure, StudyError> {
        let mut style = Style::load(&options.style)?;
        if let Some(metrics) = &options.metrics {
            name.check_count(metrics.len())?;
            style.sheet.figure.entry(name.name().to_owned()).or_default().metrics = Some(metrics.clone());
        }
        let results = self.scan(Outputs { losses: true, ..Outputs::of_figures(&[name]) })?;
        self.check_filter(results.episodes.len())?;
        let mut results = self.counted(results).results;
        self.cells_of(&results.episodes)?;
        for metric in options.metrics.iter().flatten() {
            gate::check_metric(&results.episodes, metric)?;
        }
        if let Some(top) = options.top {
            let metric = options.metrics.iter().flatten().next().cloned();
            results = results.of_the_best(top, &metric.map_or_else(|| self.leading_metric(), Ok)?);
        }
        Ok(FigureInputs::of(&results, &style)?.with(options.clone()).draw(name)?)
    }

    /// The scores of one episode, and the timesteps that decided them. Errors: as [`Study::score`]; scores in the place
    /// of traces; an unknown episode.
    pub fn explain(&self, episode_id: &str) -> Result<Evidence, StudyError> {
        let traces = self.source.traces()?;
        let definitions = self.question.bind(traces)?;
        if own_definitions::unscored(&definitions, traces, |_| true).is_some() {
            let filter = Some(format!("episode_id = '{}'", episode_id.replace('\'', "''")));
            let one = Question { filter, ..self.question.clone() }.bind(traces)?;
            own_definitions::check(&one, traces, &score_traces::score(traces, &one, &[], self.threads)?)?;
        }
        let found = evidence::explain(traces, &definitions, episode_id, self.threads);
        self.check_unchanged()?;
        Ok(found?)
    }

    /// Like [`Study::explain`], for an episode that is known to be in this input: reads no other input.
    pub fn explain_in(&self, input: &Input, episode_id: &str) -> Result<Evidence, StudyError> {
        let (one, definitions) = self.alone(input)?;
        Ok(evidence::explain(&one, &definitions, episode_id, self.threads)?)
    }

    /// Like [`Study::explain_in`], for each of these episodes that the input has, by id, in one scan.
    pub fn explain_each_in(
        &self,
        input: &Input,
        ids: &BTreeSet<String>,
    ) -> Result<BTreeMap<String, Evidence>, StudyError> {
        let (one, definitions) = self.alone(input)?;
        Ok(evidence::explain_each(&one, &definitions, ids, self.threads)?)
    }

    /// One input, with definitions bound to its own columns: a trace beside other tasks may lack their columns.
    fn alone(&self, input: &Input) -> Result<(TraceSet, Definitions), StudyError> {
        let one = labelled(std::slice::from_ref(input))?;
        let definitions = Question { filter: None, ..self.question.clone() }.bind(&one)?;
        Ok((one, definitions))
    }

    /// Compares a table of the study with a published one, cell by cell: the first that has all the published
    /// metrics. Errors: faults of the published table, the style or the inputs; no such table.
    pub fn compare(
        &self,
        published: &Path,
        style: impl AsRef<Path>,
        errata: &Errata,
    ) -> Result<PublishedComparison, StudyError> {
        // Small files first: a mistake in them should not cost a scan of the traces.
        let published = published::read(published)?;
        let style = Style::load(style)?;
        let counted = self.counted(self.score()?);
        let cells = self.cells_of(&counted.results.episodes)?;
        let left_out = (&counted.lost, None);
        let (tables, _) = self.tables(&counted.results.episodes, left_out, &cells, &style)?;
        Ok(compare(choose(&tables, &published, &style)?, &published, errata))
    }

    /// The files that an answer is made from: inputs, definitions and the style, if any. An output must not replace one
    /// of them. Includes names of built-in styles.
    pub fn files_read(&self, style: Option<&Path>) -> Vec<PathBuf> {
        let is_file = |name: &&Path| name.to_str().is_none_or(|name| file::built_in(name).is_none());
        let named = self.question.definitions.as_deref().filter(is_file).into_iter().chain(style).map(PathBuf::from);
        self.inputs.iter().map(|input| input.path.clone()).chain(named).collect()
    }

    /// Refuses a folder for outputs that contains an input: both would be read together later. Errors: an input in the
    /// folder.
    pub fn check_out(&self, out: &Path) -> Result<(), StudyError> {
        let inputs = self.inputs.iter().map(|input| &input.path);
        Ok(replace::check_folder(out, inputs).map_err(BundleError::from)?)
    }

    fn check_unchanged(&self) -> Result<(), StudyError> {
        self.stamps.iter().try_for_each(Stamp::check)
    }
}
