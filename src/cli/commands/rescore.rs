//! `rescore`: a report again from its own traces, under other definitions.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;

use super::super::args::{EngineArgs, ScoringArgs, ThreadArgs, TraceArgs};
use super::super::listing::counted;
use super::super::outcome::{Failure, Outcome};
use super::super::page::Made;
use super::super::provenance;
use super::super::sides::{self, Scored, Sides};
use super::super::{output, scoring, terminal};
use super::report::ReportArgs;
use crate::cells::changes::Changes;
use crate::report::bundle::Manifest;
use crate::report::changes::{self, Limit};
use crate::report::order::TableOrder;
use crate::report::style::Style;
use crate::score::format::{self, Partition};
use crate::score::table::EpisodeTable;
use crate::trace::open::TraceSet;

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
    pub definitions: String,
    /// The folder to write [default: REPORT_DIR-rescored]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Where the traces are: folders or files
    #[arg(long, value_name = "PLACE", num_args = 1..)]
    pub traces: Vec<PathBuf>,
    /// How tables look; needed where the report's style was a file [default: the report's]
    #[arg(long, value_name = "STYLE")]
    pub style: Option<String>,
    /// Other metrics than the report's, separated by commas
    #[arg(long, value_name = "METRICS", value_delimiter = ',')]
    pub metrics: Option<Vec<String>>,
    /// The most lines of each list of changes; --json has all
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub limit: usize,
    /// Print what was written and what changed as JSON
    #[arg(long)]
    pub json: bool,
    /// How many threads to use.
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
    /// Makes the report again.
    ///
    /// # Errors
    /// A folder that is no report, traces that are not what they were, whatever is wrong with the definitions.
    pub fn run(self) -> Result<Outcome, Failure> {
        let manifest = provenance::manifest(&self.report).map_err(Failure::input)?;
        let out = self.out()?;
        let style = self.style(&manifest)?;
        let places = provenance::places(&self.report, &self.traces);
        let inputs = provenance::traces(&manifest, &places).map_err(Failure::input)?;
        let traces = scoring::open_steps(&inputs)?;
        let before = self.scores_before(&manifest);
        let report = self.report(&manifest, out, style);
        let (made, files) = report.make(inputs)?;
        let changes = match before {
            Ok(before) => Some(self.changes(before, &made, &traces, &report)?),
            Err(reason) => {
                output::note(&format!("no comparison with the old report: {reason}"));
                None
            }
        };
        self.print(&report.out, files, made, changes)
    }

    /// The folder to write, which is not the report itself.
    fn out(&self) -> Result<PathBuf, Failure> {
        let place = |path: &Path| std::path::absolute(path).and_then(|path| path.canonicalize().or(Ok(path)));
        let out = self.out.clone().map_or_else(|| beside(&self.report), Ok)?;
        if place(&out)? == place(&self.report)? {
            return Err(Failure::Rendered(format!(
                "error: {}: expected a folder beside the report, found the report itself\n  help: the old report stays as it is; give another --out",
                out.display()
            )));
        }
        Ok(out)
    }

    /// The name or path of the style, which must be the report's own unless another is asked for.
    fn style(&self, manifest: &Manifest) -> Result<String, Failure> {
        if let Some(style) = &self.style {
            return Ok(style.clone());
        }
        let origin = &manifest.style;
        match Style::load(&origin.name) {
            Ok(style) if style.hash == origin.sha256 => Ok(origin.name.clone()),
            Ok(style) => Err(Failure::Rendered(format!(
                "error: the style `{}` changed since the report was made: expected sha256 {}, found {}\n  help: name the style with --style",
                origin.name, origin.sha256, style.hash
            ))),
            Err(_) => Err(Failure::Rendered(format!(
                "error: the report's style `{}` (sha256 {}) was a file, and a manifest keeps no paths\n  help: name the style with --style",
                origin.name, origin.sha256
            ))),
        }
    }

    /// The report as it would have been asked for.
    fn report(&self, manifest: &Manifest, out: PathBuf, style: String) -> ReportArgs {
        let selected = manifest.metrics.len() < manifest.definitions.metric.len();
        let scoring = ScoringArgs {
            definitions: Some(self.definitions.clone()),
            metrics: self.metrics.clone().or_else(|| selected.then(|| manifest.metrics.clone())),
            condition: manifest.filter.clone(),
        };
        ReportArgs {
            traces: TraceArgs { traces: Vec::new(), threads: self.threads },
            scoring,
            engine: EngineArgs::default(),
            out,
            style,
            by: manifest.by.clone(),
            no_figures: !has_figures(&self.report),
            json: self.json,
        }
    }

    /// The scores of the old report, or why they cannot be had.
    fn scores_before(&self, manifest: &Manifest) -> Result<EpisodeTable, String> {
        let path = self.report.join("episodes.parquet");
        let file = File::open(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let table = format::read_parquet(file, &Partition::default())
            .map_err(|error| format!("{}: {error}", path.display()))?;
        if table.catalog.hash == manifest.definitions.hash {
            return Ok(table);
        }
        Err(format!("{}: its definitions are not those of the manifest", path.display()))
    }

    fn changes(
        &self,
        before: EpisodeTable,
        made: &Made,
        traces: &TraceSet,
        report: &ReportArgs,
    ) -> Result<Changes, Failure> {
        let names = |table: &EpisodeTable| table.metrics.iter().map(|metric| metric.name.clone()).collect();
        let scored = |table: EpisodeTable, definitions| Scored { metrics: names(&table), table, definitions };
        let definitions = scoring::definitions(traces, &report.scoring)?;
        let sides = Sides { before: scored(before, None), after: scored(made.episodes.clone(), Some(definitions)) };
        let mut changes = sides::changes(&sides, &report.by)?;
        TableOrder { catalog: &made.cells.catalog, style: &made.style }.sort(&mut changes);
        for note in sides::explain(&mut changes, traces, &sides, self.threads.count())? {
            output::note(&note);
        }
        Ok(changes)
    }

    fn print(&self, out: &Path, files: Vec<String>, made: Made, changes: Option<Changes>) -> Result<Outcome, Failure> {
        let (out, episodes) = (out.display().to_string(), made.episodes.len());
        if self.json {
            let manifest = made.manifest;
            return output::print_json(&RescoreAnswer { out, files, episodes, manifest, changes });
        }
        if let Some(changes) = &changes {
            io::stdout().lock().write_all(changes::render(changes, Limit(self.limit), terminal::width()).as_bytes())?;
        }
        output::say(&format!("{}; the report is in {out}", counted(episodes as u64, "episode")));
        Ok(Outcome::Done)
    }
}

/// `DIR-rescored`.
fn beside(report: &Path) -> Result<PathBuf, Failure> {
    let named = if report.file_name().is_some() { report.to_owned() } else { report.canonicalize()? };
    let mut name = named.file_name().unwrap_or_default().to_owned();
    name.push("-rescored");
    Ok(named.with_file_name(name))
}

/// Whether a report was made with figures and its page.
fn has_figures(report: &Path) -> bool {
    report.join("figures").is_dir() || report.join("report.html").is_file()
}
