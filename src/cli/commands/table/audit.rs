//! `audit`: finds cells of published tables that no data can give.

use std::path::PathBuf;

use crate::cli::args::one_of;
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_exact::rounding::Rounding;
use mirrorstats_report::published::audit::MOST_EPISODES;
use mirrorstats_study::published::audit_tables;

/// Name the cells of published tables whose mean and standard error no data can give
#[derive(Clone, Debug, clap::Args)]
pub struct AuditArgs {
    /// Published tables: CSV files with the columns experiment,model,metric,mean,se,emphasis
    #[arg(required = true, value_name = "TABLE")]
    pub tables: Vec<PathBuf>,
    /// Episodes per cell; of a metric with `when`, at most
    #[arg(long = "n", value_name = "EPISODES", value_parser = clap::value_parser!(u64).range(1..=MOST_EPISODES))]
    pub n: u64,
    /// Definitions: `paper`, `extended`, or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
    pub definitions: PathBuf,
    /// Roundings to consider, separated by commas: half-even, half-up, binary, twice, truncate [default: all]
    #[arg(long, value_name = "RULES", value_delimiter = ',', value_parser = one_of(&Rounding::ALL, Rounding::name), hide_possible_values = true)]
    pub rounding: Vec<Rounding>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

impl AuditArgs {
    /// Audits; the check passes if every cell is possible.
    pub fn run(self) -> Result<Outcome, Failure> {
        let roundings = if self.rounding.is_empty() { &Rounding::ALL[..] } else { &self.rounding };
        let found = audit_tables(&self.tables, self.n, &self.definitions, roundings)?;
        output::print_rendered(&found, self.json, |found| found.render(terminal::width()))?;
        Ok(if found.holds() { Outcome::Done } else { Outcome::CheckFailed })
    }
}
