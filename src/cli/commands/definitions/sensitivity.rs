//! `sensitivity`: how the cells depend on the threshold of mirror evidence, and where a conclusion changes.

use std::path::{Path, PathBuf};

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output, terminal};
use mirrorstats_exact::replace::Content;
use mirrorstats_study::sensitivity::{DEFAULT_THRESHOLDS, SensitivityReport, Thresholds, sensitivity};

/// Show how every cell depends on the threshold of mirror evidence, and where a conclusion changes
///
/// Needs traces that record `mirror_self_px`. A threshold replaces the `let` named `visible` of the definitions by
/// `mirror_self_px >= K`.
#[derive(Clone, Debug, clap::Args)]
pub struct SensitivityArgs {
    #[command(flatten)]
    pub traces: TraceArgs,
    /// The least numbers of pixels that count as evidence, separated by commas
    #[arg(long, value_name = "PIXELS", default_value = DEFAULT_THRESHOLDS)]
    pub thresholds: Thresholds,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// Allow episodes with different settings in one cell
    #[arg(long)]
    pub pool: bool,
    /// Write sensitivity.csv, .md and .tex into this folder
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// The names of the tables in the folder.
const TABLES: [&str; 3] = ["sensitivity.csv", "sensitivity.md", "sensitivity.tex"];

impl SensitivityArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let study = self.traces.study(&self.scoring, &GroupingArgs { pool: self.pool, ..GroupingArgs::default() })?;
        if let Some(out) = &self.out {
            TABLES.iter().try_for_each(|name| output::check_target(&out.join(name), study.files_read(None)))?;
            study.check_out(out)?;
        }
        let report = sensitivity(&study, &self.thresholds)?;
        output::notes(&report.notes);
        if let Some(out) = &self.out {
            write(out, &report)?;
        }
        output::print_rendered(&report.found, self.json, |found| found.render(terminal::now()))
    }
}

fn write(out: &Path, report: &SensitivityReport) -> Result<(), Failure> {
    let found = &report.found;
    let contents = [found.csv(), found.markdown(), found.latex()];
    let files = TABLES.iter().zip(&contents).map(|(name, text)| (Path::new(name), Content::Bytes(text.as_bytes())));
    output::write_folder(out, &files.collect::<Vec<_>>())
}
