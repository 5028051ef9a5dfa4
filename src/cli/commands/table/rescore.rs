//! `rescore`: a report again from its own traces, under other definitions.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::args::ThreadArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::text_table::counted;
use crate::cli::{output, terminal};
use report::bundle::Manifest;
use report::cells::diff::Changes;
use report::changes::Limit;
use study::{RescoreRequest, Rescored, WrittenReport, folder_of_rescored};

/// Make a report again from the traces that it was made of, under other definitions
///
/// The new report keeps the filter, the grouping, the style and the choice of metrics of the old one, which stays as
/// it is. Traces are found by their hashes: below the current folder, the report's folder and the folders above it,
/// or where --traces says.
#[derive(Clone, Debug, clap::Args)]
pub struct RescoreArgs {
    /// The folder of the report
    #[arg(value_name = "REPORT_DIR")]
    pub report: PathBuf,
    /// The definitions to score under: `paper`, `extended`, or a TOML file
    #[arg(long, value_name = "NAME|FILE")]
    pub definitions: PathBuf,
    /// The folder to write [default: REPORT_DIR-rescored]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Where the traces are: folders or files
    #[arg(long, value_name = "PLACE", num_args = 1..)]
    pub traces: Vec<PathBuf>,
    /// How tables look; needed where the report's style was a file [default: the report's]
    #[arg(long, value_name = "STYLE")]
    pub style: Option<PathBuf>,
    /// Other metrics than the report's, separated by commas
    #[arg(long, value_name = "METRICS", value_delimiter = ',')]
    pub metrics: Option<Vec<String>>,
    /// The most lines of each list of changes; --json has all
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub limit: usize,
    /// Print what was written and what changed as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The answer for a program.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct RescoreAnswer {
    /// The new folder, as typed.
    pub out: String,
    /// The files in it that were written, by path inside the folder.
    pub files: Vec<String>,
    /// How many episodes were counted.
    pub episodes: usize,
    /// Where everything comes from; the same as the new `manifest.json`.
    pub manifest: Manifest,
    /// What changed from the old report; null where its scores are not readable.
    pub changes: Option<Changes>,
}

impl RescoreArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let out = folder_of_rescored(&self.report, self.out.as_deref())?;
        let rescored = self.request(&out).run()?;
        output::notes(&rescored.report.notes);
        let written = rescored.report.write(&out)?;
        match &rescored.changes {
            Ok(diff) => output::notes(&diff.notes),
            Err(reason) => output::note(&format!("no comparison with the old report: {reason}")),
        }
        self.print(&out, written, rescored)
    }

    fn request(&self, out: &Path) -> RescoreRequest {
        RescoreRequest {
            report: self.report.clone(),
            out: out.to_owned(),
            definitions: self.definitions.clone(),
            places: self.traces.clone(),
            style: self.style.clone(),
            metrics: self.metrics.clone(),
            threads: self.threads.count(),
        }
    }

    fn print(&self, out: &Path, written: WrittenReport, rescored: Rescored) -> Result<Outcome, Failure> {
        let Rescored { report, changes } = rescored;
        let changes = changes.ok().map(|diff| diff.changes);
        let (out, episodes) = (out.display().to_string(), report.results.episodes.len());
        if self.json {
            let WrittenReport { files, manifest } = written;
            return output::print_json(&RescoreAnswer { out, files, episodes, manifest, changes });
        }
        if let Some(changes) = &changes {
            io::stdout().lock().write_all(changes.render(Limit(self.limit), terminal::width()).as_bytes())?;
        }
        output::say(&format!("{}; the report is in {out}", counted(episodes as u64, "episode")));
        Ok(Outcome::Done)
    }
}
