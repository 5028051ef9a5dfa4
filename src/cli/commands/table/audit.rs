//! `audit`: finds cells of published tables that no data can give.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser as _};

use crate::cli::{Failure, Outcome, output, terminal};
use exact::rounding::Rounding;
use report::audit::episodes::Episodes;
use study::{AuditRequest, audit_tables};

/// Name the cells of published tables that no data can give, and say why
#[derive(Clone, Debug, clap::Args)]
pub struct AuditArgs {
    /// Published tables of one study: CSV files with the columns experiment,model,metric,mean,se,emphasis
    #[arg(required = true, value_name = "TABLE")]
    pub tables: Vec<PathBuf>,
    /// Episodes per row: `21`, `E1=21,E2=20`, `21,E3/GPT 5.1=19`
    #[arg(long = "n", value_name = "EPISODES")]
    pub episodes: Episodes,
    /// Definitions: `paper`, `extended`, or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
    pub definitions: PathBuf,
    /// The most steps of an episode
    #[arg(long, value_name = "STEPS", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub steps: u32,
    /// Roundings to consider, separated by commas: half-even, half-up, binary, twice, truncate [default: all]
    #[arg(long, value_name = "RULES", value_delimiter = ',', value_parser = rounding_parser(), hide_possible_values = true)]
    pub rounding: Vec<Rounding>,
    /// The style whose tables say what emphasis means, and where undefined prints as zero: `paper`, `default`, or a file
    #[arg(long, value_name = "STYLE", default_value = "paper")]
    pub style: PathBuf,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

impl AuditArgs {
    /// Audits; the check passes if every cell is possible.
    pub fn run(self) -> Result<Outcome, Failure> {
        let Self { episodes, definitions, steps, rounding: roundings, style, .. } = self;
        let found = audit_tables(&self.tables, &AuditRequest { episodes, definitions, steps, roundings, style })?;
        output::print_rendered(&found, self.json, |found| found.render(terminal::width()))?;
        Ok(if found.holds() { Outcome::Done } else { Outcome::CheckFailed })
    }
}

fn rounding_parser() -> impl clap::builder::TypedValueParser<Value = Rounding> {
    let names = Rounding::ALL.map(Rounding::name);
    PossibleValuesParser::new(names).map(|name| {
        let rounding = Rounding::ALL.into_iter().find(|rounding| rounding.name() == name);
        rounding.expect("only names of roundings are possible")
    })
}
