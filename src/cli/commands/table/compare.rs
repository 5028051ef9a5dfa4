//! `compare`: the tables of traces beside the published ones.

use std::path::PathBuf;

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_study::published::compare;

/// Compare the tables of traces with published ones, cell by cell.
#[derive(Clone, Debug, clap::Args)]
pub struct CompareArgs {
    #[command(flatten)]
    pub traces: TraceArgs,
    /// Published cells: a CSV file with the columns experiment,model,metric,mean,se,emphasis
    #[arg(long, value_name = "FILE")]
    pub published: PathBuf,
    /// Definitions: `paper`, `extended`, or a TOML file [default: those that the traces name, else paper]
    #[arg(long, value_name = "NAME|FILE")]
    pub definitions: Option<PathBuf>,
    /// The style that prints the tables: `paper` or a style file
    #[arg(long, value_name = "STYLE", default_value = "paper")]
    pub style: PathBuf,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
    /// Allow episodes with different settings in one cell
    #[arg(long)]
    pub pool: bool,
}

impl CompareArgs {
    /// Scores the traces and compares; the check passes if every difference is excused.
    pub fn run(self) -> Result<Outcome, Failure> {
        let scoring = ScoringArgs { definitions: self.definitions.clone(), ..ScoringArgs::default() };
        let study = self.traces.study(&scoring, &GroupingArgs { pool: self.pool, ..GroupingArgs::default() })?;
        let comparison = compare(&study, &self.published, &self.style)?;
        output::print_rendered(&comparison, self.json, |found| found.render(terminal::width()))?;
        Ok(if comparison.holds() { Outcome::Done } else { Outcome::CheckFailed })
    }
}
