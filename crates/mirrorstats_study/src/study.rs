//! Inputs, and the question about them: opened, checked, scanned and grouped once.

use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::thread;

use crate::StudyError;
use crate::caveats::undecided;
use crate::import::Logs;
use crate::inputs::{self, InputError, Source, Stamp, resolve};
use crate::limits::check_comparisons;
use crate::losses::{self, Counted};
use crate::own_definitions::chosen;
use crate::question::Question;
use crate::results::{Outputs, Results};
use crate::{ErrorKind, design, empty_filter, pooled, scan, scores};
use mirrorstats_analysis::plan::register::RegisteredPlan;
use mirrorstats_exact::replace;
use mirrorstats_metric::file;
use mirrorstats_report::bundle::BundleError;
use mirrorstats_score::cells::Cells;
use mirrorstats_score::cells::group::group;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::vocabulary;
use mirrorstats_trace::footers::checksums::stale_note;
use mirrorstats_trace::footers::declared::Declared;
use mirrorstats_trace::inputs::Input;
use mirrorstats_trace::read::open::TraceSet;
use mirrorstats_trace::read::steps::Steps;

/// Open inputs, and the question about them.
#[derive(Debug)]
pub struct Study {
    pub(crate) inputs: Vec<Input>,
    /// The state of each input before it was opened.
    pub(crate) stamps: Vec<Stamp>,
    pub(crate) source: Source,
    pub question: Question,
    pub(crate) threads: NonZeroUsize,
    pub(crate) plan: Option<RegisteredPlan>,
    /// The traces of logs, which exist as long as the study.
    pub logs: Option<Logs>,
}

/// The counted episodes of a study and their cells, from which answers are made.
#[derive(Debug)]
pub struct Grouped<'s> {
    pub(crate) study: &'s Study,
    pub(crate) counted: Counted,
    pub(crate) cells: Cells,
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
        let threads = thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let mut question = Question::default();
        if let Source::Traces(traces) = &source {
            // Problems with definitions are reported with the answer: the caller may set others first.
            question = question.clone().resolved(traces).unwrap_or(question);
        }
        Ok(Self { inputs, stamps, source, question, threads, plan: None, logs: None })
    }

    /// Opens these files, with a trace in place of other programs' logs. The definitions say how logs are read; those of
    /// the paper if absent. Errors: as [`Study::of`], and as `import` for logs.
    pub fn with_logs(mut inputs: Vec<Input>, definitions: Option<&Path>) -> Result<Self, StudyError> {
        let logs = Logs::of(&mut inputs, definitions)?;
        Ok(Self { logs, ..Self::of(inputs)? })
    }

    /// Sets the definitions: `paper`, `extended`, or the path of a TOML file. Errors: a file that cannot be read; every
    /// fault in it.
    pub fn definitions(self, name: impl Into<PathBuf>) -> Result<Self, StudyError> {
        let question = Question { definitions: Some(name.into()), ..self.question.clone() };
        self.asked(question)
    }

    /// Keeps the episodes that satisfy a condition in the language of definitions, such as `seed = 1 and TSA = 1`.
    /// Errors: every fault of the condition.
    pub fn filter(self, condition: &str) -> Result<Self, StudyError> {
        let question = Question { filter: Some(condition.to_owned()), ..self.question.clone() };
        self.asked(question)
    }

    /// Computes only these metrics. Errors: a metric that the definitions lack.
    pub fn metrics<T: Into<String>>(self, names: impl IntoIterator<Item = T>) -> Result<Self, StudyError> {
        let metrics = Some(names.into_iter().map(Into::into).collect());
        let question = Question { metrics, ..self.question.clone() };
        self.asked(question)
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

    /// Sets the number of threads; the default is all cores. Results do not depend on it.
    #[must_use]
    pub const fn threads(mut self, threads: NonZeroUsize) -> Self {
        self.threads = threads;
        self
    }

    /// Sets a whole question at once; definitions and filter are checked before any row is read. The scan checks that
    /// the traces have the columns, when the requested metrics are known. Errors: every fault of the definitions and the
    /// condition; a metric that the definitions lack.
    pub fn asked(mut self, question: Question) -> Result<Self, StudyError> {
        self.question = question;
        if let Source::Traces(traces) = &self.source {
            self.question = self.question.resolved(traces)?;
            self.question.bind_to(&vocabulary::trace_columns(traces))?;
        }
        Ok(self)
    }

    /// The traces, for an answer that needs steps. Errors: scores, which have no steps.
    pub fn traces(&self) -> Result<&TraceSet, StudyError> {
        Ok(self.source.traces()?)
    }

    /// The steps of the episodes that the filter keeps, with these columns in this order; all columns if absent.
    /// Errors: scores, which have no steps; a column that no trace has, or that traces have with different types; with
    /// a filter, as [`Study::score`].
    pub fn steps(&self, columns: Option<&[String]>) -> Result<Steps, StudyError> {
        let traces = self.traces()?;
        let kept = match self.question.filter {
            Some(_) => Some(self.score()?.episodes.keys.iter().map(|key| key.episode_id.to_owned()).collect()),
            None => None,
        };
        Ok(Steps::new(traces, columns, kept, self.threads)?)
    }

    /// The episode table. Errors: faults of the traces or the scores; numbers beyond 64 bits.
    pub fn score(&self) -> Result<Results, StudyError> {
        self.scan(Outputs::default())
    }

    /// Reads the inputs once. A file that changed since it was opened is an error. Errors: faults of the traces or the
    /// scores; numbers beyond 64 bits; a file that changed in between.
    pub fn scan(&self, outputs: Outputs) -> Result<Results, StudyError> {
        let (results, inputs) = thread::scope(|scope| {
            // Hashing reads the same pages; on its own thread it does not slow the scan.
            let hashing = outputs.hashes.then(|| scope.spawn(|| inputs::hashes(&self.inputs)));
            let results = match &self.source {
                Source::Scores(files) => scores::read(files, &self.question).map(Results::of),
                Source::Traces(traces) => scan::scan(traces, &self.question, outputs, self.threads),
            };
            let inputs = hashing.map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            (results, inputs)
        });
        // A changed file explains any other error.
        self.check_unchanged()?;
        let mut results = Results { inputs: inputs.transpose()?.unwrap_or_default(), ..results? };
        results.find_outcomes();
        self.declare(&mut results)?;
        results.quality = results.quality.filter(|_| outputs.quality);
        Ok(results)
    }

    /// Adds the declarations of the inputs: design, lost episodes, labels.
    pub(crate) fn declare(&self, results: &mut Results) -> Result<(), StudyError> {
        if let Source::Traces(traces) = &self.source {
            let unrecorded = losses::unrecorded(self, &results.episodes)?;
            let losses_recorded = results.lost.is_some();
            results.episodes.declared = Declared { unrecorded, losses_recorded, ..Declared::from_traces(traces) };
            design::declare(self, traces, &mut results.episodes)?;
        }
        let asked = self.question.labels();
        results.episodes.labels.retain(|label| asked.contains(&label.name) || scan::says_something(label));
        losses::label(results);
        Ok(())
    }

    /// The cells: exact moments of every metric in every group. Errors: as [`Study::score`]; a column to group by that
    /// the episodes lack.
    pub fn cells(&self) -> Result<Cells, StudyError> {
        Ok(self.group(Counted::of(self.score()?, self.question.lost))?.cells)
    }

    /// The counted episodes and their cells, from a scan. Errors: as [`Study::cells`]; a filter that keeps no episode.
    pub fn grouped(&self) -> Result<Grouped<'_>, StudyError> {
        self.grouped_with(Outputs { copy_candidates: true, design: true, ..Outputs::default() })
    }

    pub(crate) fn grouped_with(&self, outputs: Outputs) -> Result<Grouped<'_>, StudyError> {
        let results = self.scan(outputs)?;
        self.check_filter(results.episodes.len())?;
        self.group(Counted::of(results, self.question.lost))
    }

    pub(crate) fn group(&self, counted: Counted) -> Result<Grouped<'_>, StudyError> {
        let mut cells = self.cells_of(&counted.results.episodes)?;
        cells.add_lost(undecided(self, &counted.lost).iter().map(|(key, _)| key));
        Ok(Grouped { study: self, counted, cells })
    }

    /// The cells of these episodes. Errors: a column to group by that the episodes lack; a cell that mixes episodes
    /// recorded differently.
    pub(crate) fn cells_of(&self, episodes: &EpisodeTable) -> Result<Cells, StudyError> {
        let by = self.question.by_over(episodes);
        if !self.question.pool {
            pooled::check(episodes, &by)?;
        }
        check_comparisons(episodes)?;
        Ok(group(episodes, &by)?)
    }

    /// The explanation of a filter that keeps no episode; `None` if there are episodes or there is no filter. Errors:
    /// faults of the inputs without the filter.
    pub fn empty_filter(&self, episodes: usize) -> Result<Option<String>, StudyError> {
        if episodes > 0 { Ok(None) } else { empty_filter::explained(&self.source, &self.question, self.threads) }
    }

    pub(crate) fn check_filter(&self, episodes: usize) -> Result<(), StudyError> {
        self.empty_filter(episodes)?.map_or(Ok(()), |words| {
            let help = "help: give a filter that holds for some of them, or none";
            Err(StudyError::new(ErrorKind::Argument, format!("{words}\n  {help}")))
        })
    }

    /// A sentence about traces whose checksums belong to another version of the file.
    pub fn stale_checksums(&self) -> Option<String> {
        self.traces().ok().and_then(|traces| stale_note(traces.files()))
    }

    /// The definitions that score all experiments of the traces, named by their footers; `None` for the default ones.
    /// Errors: scores in the place of traces; experiments that need different definitions; definitions in a file of the
    /// recorder's.
    pub fn own_definitions(&self) -> Result<Option<PathBuf>, StudyError> {
        Ok(chosen(self.traces()?)?)
    }

    /// A note if the definitions are those that the traces carry.
    pub fn carried_note(&self) -> Option<String> {
        let carried = self.question.carried.as_ref()?;
        Some(format!("the definitions `{}` are those that the traces carry; --definitions names others", carried.name))
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

    pub(crate) fn check_unchanged(&self) -> Result<(), InputError> {
        self.stamps.iter().try_for_each(Stamp::check)
    }
}
