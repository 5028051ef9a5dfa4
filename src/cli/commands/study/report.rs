//! `report`: all tables of the study from traces, on the terminal and in a folder.

use std::io::{self, Write as _};
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::registered::with_plan;
use crate::cli::{Failure, Outcome, output};
use mirrorstats_exact::format::counted;
use mirrorstats_report::bundle::Manifest;
use mirrorstats_study::report::{self, Report, ReportOptions, WrittenReport};

/// Compute tables and figures of traces: print the main table, write all of them
#[derive(Clone, Debug, clap::Args)]
pub struct ReportArgs {
    #[command(flatten)]
    pub traces: TraceArgs,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// The folder to write
    #[arg(short, long, value_name = "DIR", default_value = "reports/latest")]
    pub out: PathBuf,
    /// The style of tables: `default`, `paper`, or a TOML file
    #[arg(long, value_name = "STYLE", default_value = "default")]
    pub style: PathBuf,
    #[command(flatten)]
    pub grouping: GroupingArgs,
    /// Write only tables, cells and provenance: no figures and no report.html
    #[arg(long)]
    pub no_figures: bool,
    /// Draw each figure as PNG too, which takes longer than SVG and PDF together
    #[cfg(feature = "raster")]
    #[arg(long, conflicts_with = "no_figures")]
    pub png: bool,
    /// A registered plan: each departure of the analysis from it is listed
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Print what was written as JSON instead of the table
    #[arg(long)]
    pub json: bool,
}

/// The answer for a program.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ReportAnswer {
    /// The folder, as typed.
    pub out: String,
    /// The files in it that were written, by path inside the folder.
    pub files: Vec<String>,
    /// The number of counted episodes.
    pub episodes: usize,
    /// Warnings for readers of the tables.
    pub warnings: Vec<String>,
    /// The origin of everything; the same as `manifest.json`.
    pub manifest: Manifest,
}

impl ReportArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        let study = self.traces.study(&self.scoring, &self.grouping)?;
        let study = with_plan(study, self.plan.as_deref())?;
        #[cfg(feature = "raster")]
        let png = self.png;
        #[cfg(not(feature = "raster"))]
        let png = false;
        let options = ReportOptions { style: self.style.clone(), figures: !self.no_figures, png };
        report::check_folder(&study, &self.out, &options)?;
        let report = report::report(&study, &options)?;
        output::notes(&report.notes);
        let warnings = study.stale_checksums().into_iter().chain(report.notes.iter().cloned()).collect();
        let WrittenReport { files, manifest } = report.write(&self.out)?;
        if self.json {
            let (out, episodes) = (self.out.display().to_string(), report.results.episodes.len());
            return output::print_json(&ReportAnswer { out, files, episodes, warnings, manifest });
        }
        self.print(&report)
    }

    fn print(&self, report: &Report) -> Result<Outcome, Failure> {
        let mut out = io::stdout().lock();
        if let Some(table) = report.main_table() {
            out.write_all(table.printed().terminal(crate::cli::terminal::now()).as_bytes())?;
        }
        if let Some(table) = report.other_table() {
            writeln!(out, "\n{}: metrics that the style does not list", table.title)?;
            out.write_all(table.printed().terminal(crate::cli::terminal::now()).as_bytes())?;
        }
        if let Some(replies) = &report.replies {
            writeln!(out, "\n{replies}")?;
        }
        let episodes = counted(report.results.episodes.len() as u64, "episode");
        output::say(&format!("{episodes}; the report is in {}", self.out.display()));
        if !self.no_figures {
            output::say(&format!("open {}", self.out.join("report.html").display()));
        }
        output::say("next: `mirrorstats stats` tests these differences");
        Ok(Outcome::Done)
    }
}
