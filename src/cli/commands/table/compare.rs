//! `compare`: the tables of traces beside the published ones.

use std::path::{Path, PathBuf};

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_report::errata::Errata;
use mirrorstats_study::published::compare;

/// The style that printed the published tables.
const PAPER_STYLE: &str = "paper";

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
    #[arg(long, value_name = "STYLE", default_value = PAPER_STYLE)]
    pub style: PathBuf,
    /// Differences that are slips of the publication [default: those of the paper, with its style]
    #[arg(long, value_name = "FILE")]
    pub errata: Option<PathBuf>,
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
        let errata = self.errata()?;
        let scoring = ScoringArgs { definitions: self.definitions.clone(), ..ScoringArgs::default() };
        let study = self.traces.study(&scoring, &GroupingArgs { pool: self.pool, ..GroupingArgs::default() })?;
        let comparison = compare(&study, &self.published, &self.style, &errata)?;
        output::print_rendered(&comparison, self.json, |found| found.render(terminal::width()))?;
        Ok(if comparison.holds() { Outcome::Done } else { Outcome::CheckFailed })
    }

    fn errata(&self) -> Result<Errata, Failure> {
        match &self.errata {
            Some(path) => Ok(Errata::read(path)?),
            None if self.style == Path::new(PAPER_STYLE) => Ok(Errata::of_paper()),
            None => Ok(Errata::default()),
        }
    }
}
