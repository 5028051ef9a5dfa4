//! `mirrorstats trace validate`: checks every rule of the schema and reports all findings.

use std::io;
use std::path::PathBuf;

use crate::cli::args::TraceArgs;
use crate::cli::{Failure, Outcome, output};
use mirrorstats_study::findings::{findings, findings_text};
use mirrorstats_trace::diagnostic::Severity;
use mirrorstats_trace::footers::answered::by_others;
use mirrorstats_trace::inputs;
use mirrorstats_trace::read::open::TraceFile;

/// Check traces against every rule of the schema and report every problem
///
/// Exits with 1 if a rule does not hold; notes do not count.
#[derive(Clone, Debug, clap::Args)]
pub struct ValidateCommand {
    #[command(flatten)]
    input: TraceArgs,
    /// The definitions whose experiments are known: `paper`, `extended`, or a TOML file [default: those that the traces
    /// carry, else `paper`]
    #[arg(long, value_name = "NAME|FILE")]
    definitions: Option<PathBuf>,
    /// Print all findings as JSON
    #[arg(long)]
    json: bool,
}

impl ValidateCommand {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let inputs = inputs::resolve(&self.input.traces, io::stdin())?;
        let report = findings(self.definitions.as_deref(), &inputs, self.input.threads.count())?;
        let files: Vec<_> = inputs.iter().filter_map(|input| TraceFile::open(input).ok()).collect();
        output::notes(&by_others(&files));
        output::print_rendered(&report, self.json, findings_text)?;
        Ok(if report.count(Severity::Error) == 0 { Outcome::Done } else { Outcome::CheckFailed })
    }
}
