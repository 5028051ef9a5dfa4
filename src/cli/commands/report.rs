//! `report`: every table of the study from traces, on the terminal and as a folder.

use std::io::{self, Write as _};
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::Serialize;

use super::super::args::{EngineArgs, ScoringArgs, TraceArgs};
use super::super::listing::counted;
use super::super::outcome::{Failure, Outcome};
use super::super::page::{Asked, MOST_EPISODES, Made, figure_files};
use super::super::{empty_filter, output, scoring};
use crate::cells::group::{DEFAULT_BY, group};
use crate::report::bundle::{self, Bundle, Manifest, Written};
use crate::report::layout;
use crate::report::style::{MAIN_TABLE, Style};
use crate::report::table::Table;
use crate::report::tables::terminal;
use crate::score::format;
use crate::trace::inputs::Input;
use crate::trace::schema::SCHEMA_VERSION;

/// Compute the tables and figures of traces, print the main table, write all of them
#[derive(Clone, Debug, clap::Args)]
pub struct ReportArgs {
    /// Traces, or files of scores in their place.
    #[command(flatten)]
    pub traces: TraceArgs,
    /// How the metrics are defined.
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// What computes it.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// The folder to write
    #[arg(long, value_name = "DIR", default_value = "reports/latest")]
    pub out: PathBuf,
    /// How tables look: `default`, `paper`, or a TOML file
    #[arg(long, value_name = "STYLE", default_value = "default")]
    pub style: String,
    /// Group episodes by these columns, separated by commas [default: experiment,model]
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', default_values = DEFAULT_BY, hide_default_value = true)]
    pub by: Vec<String>,
    /// Write tables, cells and provenance alone: no figures, no report.html
    #[arg(long)]
    pub no_figures: bool,
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
    /// How many episodes were counted.
    pub episodes: usize,
    /// Where everything comes from; the same as `manifest.json`.
    pub manifest: Manifest,
}

impl ReportArgs {
    /// Reports.
    ///
    /// # Errors
    /// Whatever is wrong with the traces, the definitions, the style or the folder.
    pub fn run(self) -> Result<Outcome, Failure> {
        let inputs = scoring::resolve(&self.traces)?;
        let (made, files) = self.make(inputs)?;
        if self.json {
            let out = self.out.display().to_string();
            let Made { episodes, manifest, .. } = made;
            return output::print_json(&ReportAnswer { out, files, episodes: episodes.len(), manifest });
        }
        self.print(&made.tables, made.episodes.len())
    }

    /// Makes the report of these files and writes its folder; returns what was made and the files written.
    ///
    /// # Errors
    /// Whatever is wrong with the traces, the definitions, the style or the folder.
    pub fn make(&self, inputs: Vec<Input>) -> Result<(Made, Vec<String>), Failure> {
        let read = output::files_read(&inputs, &[self.scoring.definitions.as_deref(), Some(&self.style)]);
        bundle::check_old(&self.out, &read).map_err(Failure::input)?;
        // Small files first: a slip in the style should not cost a pass over the traces.
        let style = Style::load(&self.style).map_err(Failure::input)?;
        let labels = scoring::labels(&self.by);
        let threads = self.traces.threads.count();
        let episodes = scoring::table_on(&self.engine, &inputs, &self.scoring, &labels, threads)?;
        empty_filter::check(episodes.len(), &inputs, &self.scoring, threads)?;
        let cells = group(&episodes, &self.by).map_err(Failure::input)?;
        let tables = layout::tables(&cells, &style).map_err(Failure::input)?;
        let condition = self.scoring.condition.clone();
        let manifest = Manifest::new(&cells, &style, SCHEMA_VERSION, condition, scoring::provenance(&inputs)?);
        let mut made = Made { inputs, episodes, cells, tables, manifest, style };
        let written = self.write(&made, &read)?;
        made.manifest = written.manifest;
        let inside = |path: &PathBuf| path.strip_prefix(&self.out).unwrap_or(path).display().to_string();
        Ok((made, written.files.iter().map(inside).collect()))
    }

    fn write(&self, made: &Made, read: &[PathBuf]) -> Result<Written, Failure> {
        let mut others = Vec::new();
        if !self.no_figures {
            let asked = Asked { scoring: &self.scoring, threads: self.traces.threads.count() };
            let drawings = asked.drawings(made)?;
            for (name, reason) in &drawings.left_out {
                output::note(&format!("no figure `{name}`: {reason}"));
            }
            others.extend(figure_files(&drawings)?);
            match asked.page(made, &drawings)? {
                Some(page) => others.push(page),
                None => output::note(&format!("no report.html: it lists at most {MOST_EPISODES} episodes")),
            }
        }
        let mut bytes = Vec::new();
        format::write(&made.episodes, format::Format::Parquet, &mut bytes).map_err(Failure::input)?;
        let Made { cells, tables, manifest, .. } = made;
        let bundle = Bundle { cells, tables, episodes: &bytes, manifest, read, others: &others };
        bundle::write(&self.out, &bundle).map_err(Failure::input)
    }

    fn print(&self, tables: &[Table], episodes: usize) -> Result<Outcome, Failure> {
        let main = tables.iter().find(|table| table.name == MAIN_TABLE).or(tables.first());
        let mut out = io::stdout().lock();
        if let Some(table) = main {
            out.write_all(terminal::render(table, super::super::terminal::now()).as_bytes())?;
        }
        let episodes = counted(episodes as u64, "episode");
        output::say(&format!("{episodes}; the report is in {}", self.out.display()));
        Ok(Outcome::Done)
    }
}
