//! `diff`: the changes under another set of definitions, or between sets of scores.

use std::ffi::OsString;
use std::io;
use std::path::PathBuf;

use crate::cli::args::ThreadArgs;
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_analysis::changes::Changes;
use mirrorstats_score::cells::group::DEFAULT_BY;
use mirrorstats_study::diff::{DiffRequest, Side, diff};
use mirrorstats_study::import::Logs;
use mirrorstats_study::inputs::resolve;

/// Show which cells and episodes change under other definitions: two sets of definitions, or of scores
#[derive(Clone, Debug, clap::Args)]
pub struct DiffArgs {
    /// The definitions before: `paper`, `extended`, or a TOML file; or a file of scores, or a report's folder
    #[arg(value_name = "OLD")]
    pub old: PathBuf,
    /// The definitions after, or scores
    #[arg(value_name = "NEW")]
    pub new: PathBuf,
    /// The traces to score; with two files of scores, the traces that show which timesteps decided
    #[arg(value_name = "TRACES")]
    pub traces: Vec<OsString>,
    /// Only these metrics, separated by commas [default: all]
    #[arg(long, value_name = "METRICS", value_delimiter = ',')]
    pub metrics: Option<Vec<String>>,
    /// Only episodes where this holds on both sides, in the language of definitions, such as "seed = 1"
    #[arg(long = "where", value_name = "EXPR")]
    pub condition: Option<String>,
    /// Group episodes by these columns, separated by commas [default: experiment,model]
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', default_values = DEFAULT_BY, hide_default_value = true)]
    pub by: Vec<String>,
    /// Definitions of scores that do not carry their own: CSV, JSON lines, other engines' Parquet [default: paper]
    #[arg(long, value_name = "NAME|FILE")]
    pub definitions: Option<PathBuf>,
    /// The most lines of each list on the terminal; --json has all
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub limit: usize,
    /// Exit with 1 if a cell moved, a value flipped, or one side lacks a metric or an episode
    #[arg(long)]
    pub fail_on_change: bool,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

impl DiffArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let (old, new) = (Side::of(&self.old)?, Side::of(&self.new)?);
        let mut traces = resolve(&self.traces, io::stdin().lock())?;
        let logs = Logs::of(&mut traces, Some(&self.new))?;
        output::notes(logs.as_ref().map_or(&[][..], |logs| &logs.notes));
        output::note_stale_checksums(&traces);
        let found = diff(&old, &new, &traces, &self.request())?;
        output::notes(&found.notes);
        self.print(&found.changes)
    }

    fn request(&self) -> DiffRequest {
        DiffRequest {
            metrics: self.metrics.clone(),
            filter: self.condition.clone(),
            by: self.by.clone(),
            definitions_of_scores: self.definitions.clone(),
            threads: self.threads.count(),
        }
    }

    fn print(&self, changes: &Changes) -> Result<Outcome, Failure> {
        output::print_rendered(changes, self.json, |changes| changes.render(self.limit, terminal::width()))?;
        let failed = self.fail_on_change && !changes.is_empty();
        Ok(if failed { Outcome::CheckFailed } else { Outcome::Done })
    }
}
