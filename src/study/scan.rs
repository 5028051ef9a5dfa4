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
use crate::score::format::{self, Format};
use crate::score::run::{self, ScoreError};
use crate::score::table::EpisodeTable;
use crate::score::timeline::{self, Timeline};
use crate::trace::open::TraceSet;

/// The most episodes whose timelines are kept: figures draw each of them.
pub const MOST_TIMELINES: usize = 2_000;

/// What a scan gives beside the episode table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// When each agent looked, claimed and decided.
    pub timelines: bool,
    /// The episodes that the infrastructure ended.
    pub losses: bool,
    /// The hashes of the inputs.
    pub hashes: bool,
}

/// What a scan gave.
#[derive(Debug)]
pub struct Results {
    /// One row per episode.
    pub episodes: EpisodeTable,
    /// One timeline per episode, in the order of the table. `None` where they were not asked for, for scores, for
    /// definitions that do not name the moments, and for more than [`MOST_TIMELINES`] episodes.
    pub timelines: Option<Vec<Timeline>>,
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

    /// Writes the episode table; the memory that it takes does not grow with the number of episodes where the native engine
    /// scores traces.
    ///
    /// # Errors
    /// As [`Study::scan`]; whatever writing gives. What was written before an error is not the whole table.
    pub fn write_scores(&self, format: Format, out: impl Write + Send) -> Result<(), StudyError> {
        let written = match (&self.source, &self.backend) {
            (Source::Traces(traces), Backend::Native) => self.stream(traces, format, out),
            _ => Ok(format::write(&self.table()?, format, out)?),
        };
        self.check_unchanged()?;
        written
    }

    fn stream(&self, traces: &TraceSet, format: Format, out: impl Write + Send) -> Result<(), StudyError> {
        let mut rows = run::rows(traces, &self.question.bind(traces)?, &self.question.labels(), self.threads)?;
        let header = rows.header().clone();
        format::write_rows(header, format, out, |write| {
            while let Some(row) = rows.next_row().map_err(ScoreError::Spill)? {
                write(row)?;
            }
            Ok(())
        })
    }

    fn scan_rows(&self, outputs: Outputs) -> Result<Results, StudyError> {
        let episodes = self.table()?;
        let (mut timelines, mut lost) = (None, None);
        if let Source::Traces(traces) = &self.source {
            if outputs.timelines && episodes.len() <= MOST_TIMELINES {
                timelines = timeline::timelines(traces, &self.question.bind(traces)?, self.threads)?;
            }
            if outputs.losses {
                lost = self.lost(traces)?;
            }
        }
        Ok(Results { episodes, timelines, lost, inputs: Vec::new() })
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
