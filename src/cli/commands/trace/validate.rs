//! `mirrorstats trace validate`: checks every rule of the schema and reports all findings.

use std::io::{self, Write as _};
use std::path::PathBuf;

use crate::cli::args::TraceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use study::{findings, findings_text};
use trace::answered::by_others;
use trace::diagnostic::Severity;
use trace::inputs;
use trace::open::TraceFile;

/// Check traces against every rule of the schema and report all that is wrong
///
/// Exits with 1 if a rule does not hold; notes do not count.
#[derive(Clone, Debug, clap::Args)]
pub struct ValidateCommand {
    #[command(flatten)]
    input: TraceArgs,
    /// The definitions whose experiments are known: `paper`, `extended`, or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "paper")]
    definitions: PathBuf,
    /// Print all findings as JSON
    #[arg(long)]
    json: bool,
}

impl ValidateCommand {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let inputs = inputs::resolve(&self.input.traces, io::stdin()).map_err(Failure::input)?;
        let report = findings(&self.definitions, &inputs, self.input.threads.count())?;
        let files: Vec<_> = inputs.iter().filter_map(|input| TraceFile::open(input).ok()).collect();
        output::notes(&by_others(&files));
        let mut out = io::stdout().lock();
        if self.json {
            writeln!(out, "{:#}", serde_json::json!(report))?;
        } else {
            out.write_all(findings_text(&report).as_bytes())?;
        }
        Ok(if report.count(Severity::Error) == 0 { Outcome::Done } else { Outcome::CheckFailed })
    }
}
