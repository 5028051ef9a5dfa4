//! `mirrorstats trace validate`: every rule of the schema, all findings.

use std::io::{self, Write};
use std::path::PathBuf;

use crate::cli::args::TraceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::text_table::counted;
use exact::escape::visible;
use study::{experiment_findings, known_experiments};
use trace::answered::by_others;
use trace::checksums::Checksums;
use trace::diagnostic::Severity;
use trace::inputs;
use trace::open::TraceFile;
use trace::validate::{Validation, validate};

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

/// Findings that are printed for each file and rule.
const SHOWN: usize = 10;

impl ValidateCommand {
    pub fn run(&self) -> Result<Outcome, Failure> {
        let report = self.findings()?;
        let mut out = io::stdout().lock();
        if self.json {
            writeln!(out, "{:#}", serde_json::json!(report))?;
        } else {
            print(&mut out, &report)?;
        }
        Ok(if report.count(Severity::Error) == 0 { Outcome::Done } else { Outcome::CheckFailed })
    }

    pub fn findings(&self) -> Result<Validation, Failure> {
        let experiments = known_experiments(&self.definitions)?;
        let inputs = inputs::resolve(&self.input.traces, io::stdin()).map_err(Failure::input)?;
        let threads = self.input.threads.count();
        let mut report = validate(&inputs, experiments.as_deref(), threads).map_err(Failure::input)?;
        let files: Vec<_> = inputs.iter().filter_map(|input| TraceFile::open(input).ok()).collect();
        output::notes(&by_others(&files));
        report.findings.extend(experiment_findings(&self.definitions, &inputs)?);
        Ok(report)
    }
}

/// The findings for people, some of each kind, and how many there are.
pub fn print(out: &mut impl Write, report: &Validation) -> io::Result<()> {
    let (shown, rest) = report.abridged(SHOWN);
    for finding in shown {
        writeln!(out, "{finding}\n")?;
    }
    for rest in &rest {
        writeln!(out, "{}: {}, and {} more of these", rest.code, visible(rest.file), rest.count)?;
    }
    if !rest.is_empty() {
        writeln!(out, "`--json` prints all findings\n")?;
    }
    let incomplete = report.files.iter().filter(|file| !file.complete).count();
    let unchecked = report.files.iter().filter(|file| file.complete && file.checksums == Checksums::None);
    match unchecked.count() as u64 {
        0 => {}
        count => writeln!(out, "no checksums in {}: damage to their data may not be found", counted(count, "file"))?,
    }
    let (episodes, steps) = report
        .files
        .iter()
        .fold((0_u64, 0_u64), |(episodes, steps), file| (episodes + file.episodes, steps + file.steps));
    let files = counted(report.files.len() as u64, "file");
    write!(out, "{files}, {}, {} checked", counted(episodes, "episode"), counted(steps, "step"))?;
    if incomplete > 0 {
        write!(out, " ({incomplete} of the files not to their end)")?;
    }
    let [errors, notes] = [Severity::Error, Severity::Note].map(|severity| report.count(severity) as u64);
    writeln!(out, ": {}, {}", counted(errors, "error"), counted(notes, "note"))
}
