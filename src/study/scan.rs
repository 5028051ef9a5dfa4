//! The one pass over the inputs, and everything that it gives.

use std::collections::BTreeSet;
use std::io::Write;
use std::thread;

use super::error::StudyError;
use super::inputs::Source;
use super::{Backend, Study, backend, input_hashes, scores};
use crate::cells::losses::INFRASTRUCTURE;
use crate::metric::definitions::Definitions;
use crate::report::bundle;
use crate::report::figures::e5_outcomes::Outcomes;
use crate::report::figures::{FigureName, gaze};
use crate::score::format::{self, Format};
use crate::score::run::{self, ScoreError};
use crate::score::table::EpisodeTable;
use crate::score::timeline::{self, Timeline};
use crate::trace::open::TraceSet;

/// What a scan gives beside the episode table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// When each agent looked, claimed and decided: for the figure `gaze`.
    pub timelines: bool,
    /// How open questions ended: for the figure `e5-outcomes`.
    pub outcomes: bool,
    /// The episodes that the infrastructure ended.
    pub losses: bool,
    /// The hashes of the inputs.
    pub hashes: bool,
}

impl Outputs {
    /// What figures of these names are drawn from.
    pub fn of_figures(names: &[FigureName]) -> Self {
        let (timelines, outcomes) = (names.contains(&FigureName::Gaze), names.contains(&FigureName::E5Outcomes));
        Self { timelines, outcomes, ..Self::default() }
    }
}

/// What a scan gave.
#[derive(Debug)]
pub struct Results {
    /// One row per episode.
    pub episodes: EpisodeTable,
    /// One timeline per episode, in the order of the table. `None` where they were not asked for, for scores, for
    /// definitions that do not name the moments, and for more episodes than `gaze` draws.
    pub timelines: Option<Vec<Timeline>>,
    /// How open questions ended. `None` where that was not asked for, and where there is no such question.
    pub outcomes: Option<Outcomes>,
    /// The ids of the episodes without `done` whose last reply was lost to the infrastructure. `None` where they were not
    /// asked for, and where the inputs do not record it.
    pub lost: Option<BTreeSet<String>>,
    /// The inputs with their hashes; empty where they were not asked for.
    pub inputs: Vec<bundle::Input>,
}

impl Study {
    /// Reads the inputs once. A file that changed since it was opened is an error.
    ///
    /// # Errors
    /// Whatever is wrong with the traces or the scores; numbers beyond 64 bits; a file that changed in between.
    pub fn scan(&self, outputs: Outputs) -> Result<Results, StudyError> {
        let (results, inputs) = thread::scope(|scope| {
            // Hashes read the same pages of the files; on their own thread they cost no time of the scan.
            let hashing = outputs.hashes.then(|| scope.spawn(|| input_hashes::hashes(&self.inputs)));
            let results = self.scan_rows(outputs);
            let inputs = hashing.map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            (results, inputs)
        });
        // A change explains whatever else went wrong.
        self.check_unchanged()?;
        Ok(Results { inputs: inputs.transpose()?.unwrap_or_default(), ..results? })
    }

    /// Writes the episode table and returns its number of rows; the memory that it takes does not grow with the number of episodes where the native engine
    /// scores traces.
    ///
    /// # Errors
    /// As [`Study::scan`]; whatever writing gives. What was written before an error is not the whole table.
    pub fn write_scores(&self, format: Format, out: impl Write + Send) -> Result<usize, StudyError> {
        let written = match (&self.source, &self.backend) {
            (Source::Traces(traces), Backend::Native) => self.stream(traces, format, out),
            _ => {
                let table = self.table()?;
                format::write(&table, format, out)?;
                Ok(table.len())
            }
        };
        self.check_unchanged()?;
        written
    }

    fn stream(&self, traces: &TraceSet, format: Format, out: impl Write + Send) -> Result<usize, StudyError> {
        let mut rows = run::rows(traces, &self.question.bind(traces)?, &self.question.labels(), self.threads)?;
        let (header, mut count) = (rows.header().clone(), 0);
        format::write_rows(header, format, out, |write| {
            while let Some(row) = rows.next_row().map_err(ScoreError::Spill)? {
                write(row)?;
                count += 1;
            }
            Ok::<_, StudyError>(())
        })?;
        Ok(count)
    }

    fn scan_rows(&self, outputs: Outputs) -> Result<Results, StudyError> {
        let episodes = self.table()?;
        let mut results = Results { episodes, timelines: None, outcomes: None, lost: None, inputs: Vec::new() };
        if let Source::Traces(traces) = &self.source {
            self.add_timelines(traces, outputs, &mut results)?;
            if outputs.losses {
                results.lost = self.lost(traces)?;
            }
        }
        Ok(results)
    }

    /// Adds timelines of as many episodes as a figure shows, and how open questions ended.
    fn add_timelines(&self, traces: &TraceSet, outputs: Outputs, results: &mut Results) -> Result<(), StudyError> {
        let episodes = &results.episodes;
        let shows_each = outputs.timelines && episodes.len() <= gaze::MOST_EPISODES;
        let shows_ends = outputs.outcomes && Outcomes::are_there(episodes);
        if !shows_each && !shows_ends {
            return Ok(());
        }
        // Neither needs a metric, and so no column that only a metric left out would read.
        let definitions = self.question.bind(traces)?;
        let timelines = if shows_each { timeline::timelines(traces, &definitions, self.threads)? } else { None };
        let answered = match &timelines {
            Some(timelines) => Some(timelines.iter().map(|timeline| timeline.answered).collect()),
            None if shows_ends => timeline::answered(traces, &definitions, &episodes.keys, self.threads)?,
            None => None,
        };
        results.outcomes = answered.and_then(|answered: Vec<bool>| Outcomes::of(&results.episodes, &answered));
        results.timelines = timelines;
        Ok(())
    }

    fn table(&self) -> Result<EpisodeTable, StudyError> {
        let labels = self.question.labels();
        match (&self.source, &self.backend) {
            (Source::Scores(files), Backend::Native) => scores::read(files, &self.question),
            (Source::Traces(traces), Backend::Native) => {
                Ok(run::score(traces, &self.question.bind(traces)?, &labels, self.threads)?)
            }
            (source, Backend::Polars) => backend::polars(source.traces()?, &self.question, self.threads),
            (_, Backend::Spark(cluster)) => backend::SparkJob::of_study(self, cluster.clone())?.score(),
        }
    }

    /// The episodes that the infrastructure ended: without `done`, their last reply lost.
    fn lost(&self, traces: &TraceSet) -> Result<Option<BTreeSet<String>>, StudyError> {
        if traces.column("reply_status").is_none_or(|column| column.missing_from.is_some() || column.conflict.is_some())
        {
            return Ok(None);
        }
        let columns = run::trace_columns(traces);
        let statuses: Vec<String> = INFRASTRUCTURE.iter().map(|status| format!("'{status}'")).collect();
        let ended =
            format!("first(action = 'done') is null and at(reply_status, length()) in ({})", statuses.join(", "));
        let nothing = Definitions::from_toml("losses", "", &columns)?;
        let definitions = nothing.filtered("losses", &ended, &columns)?;
        let table = run::score(traces, &definitions, &[], self.threads)?;
        Ok(Some(table.keys.into_iter().map(|key| key.episode_id).collect()))
    }
}
