//! `report`: every table of the study from traces, on the terminal and as a folder.

use std::io::{self, IsTerminal as _, Write as _};
use std::path::PathBuf;

use clap::ValueEnum as _;
use schemars::JsonSchema;
use serde::Serialize;

use super::super::args::{ScoringArgs, TraceArgs};
use super::super::outcome::{Failure, Outcome};
use super::super::{output, scoring};
use super::figure::Format;
use crate::cells::cell::Cells;
use crate::cells::group::{DEFAULT_BY, group};
use crate::cli::drawing::Sources;
use crate::report::bundle::{self, Bundle, Manifest, OutputFile};
use crate::report::layout;
use crate::report::style::{MAIN_TABLE, Style};
use crate::report::table::Table;
use crate::report::tables::terminal::{self, Marks, Terminal};
use crate::score::format;
use crate::score::table::EpisodeTable;
use crate::trace::inputs::Input;

/// Compute the tables of traces, print the main one, write all of them
#[derive(Clone, Debug, clap::Args)]
pub struct ReportArgs {
    /// Traces, or files of scores in their place.
    #[command(flatten)]
    pub traces: TraceArgs,
    /// How the metrics are defined.
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// The folder to write
    #[arg(long, value_name = "DIR", default_value = "reports/latest")]
    pub out: PathBuf,
    /// How tables look: `default`, `paper`, or a TOML file
    #[arg(long, value_name = "STYLE", default_value = "default")]
    pub style: String,
    /// Group episodes by these columns, separated by commas [default: experiment,model]
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', default_values = DEFAULT_BY, hide_default_value = true)]
    pub by: Vec<String>,
    /// Write tables, cells and provenance alone
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
        // Small files first: a slip in the style should not cost a pass over the traces.
        let style = Style::load(&self.style).map_err(Failure::input)?;
        let inputs = scoring::resolve(&self.traces)?;
        let labels = scoring::labels(&self.by);
        let episodes = scoring::table(&inputs, &self.scoring, &labels, self.traces.threads.count())?;
        let cells = group(&episodes, &self.by).map_err(Failure::input)?;
        let tables = layout::tables(&cells, &style).map_err(Failure::input)?;
        let condition = self.scoring.condition.clone();
        let manifest =
            Manifest::new(&cells, &style, scoring::schema_version(), condition, scoring::provenance(&inputs)?);
        let figures = if self.no_figures { Vec::new() } else { self.figures(&inputs, &episodes, &style)? };
        let files = self.write(&episodes, &cells, &tables, &manifest, &figures)?;
        if self.json {
            let out = self.out.display().to_string();
            return output::print_json(&ReportAnswer { out, files, episodes: episodes.len(), manifest });
        }
        self.print(&tables, episodes.len())
    }

    /// Every figure that can be drawn, in every format; why another one cannot is told on standard error.
    fn figures(&self, inputs: &[Input], episodes: &EpisodeTable, style: &Style) -> Result<Vec<OutputFile>, Failure> {
        let sources = Sources::of(inputs, &self.scoring, episodes, style, self.traces.threads.count())?;
        let drawings = sources.draw_all();
        for (name, reason) in drawings.left_out {
            writeln!(io::stderr(), "note: no figure `{name}`: {reason}")?;
        }
        let mut files = Vec::new();
        for (name, figure) in &drawings.drawn {
            for format in Format::value_variants() {
                let path = format!("figures/{name}.{}", format.ending()).into();
                files.push(OutputFile { path, bytes: format.encode(figure)? });
            }
        }
        Ok(files)
    }

    fn write(
        &self,
        episodes: &EpisodeTable,
        cells: &Cells,
        tables: &[Table],
        manifest: &Manifest,
        figures: &[OutputFile],
    ) -> Result<Vec<String>, Failure> {
        let mut bytes = Vec::new();
        format::write(episodes, format::Format::Parquet, &mut bytes).map_err(Failure::input)?;
        let bundle = Bundle { cells, tables, episodes: &bytes, manifest, others: figures };
        let written = bundle::write(&self.out, &bundle).map_err(Failure::input)?;
        let inside = |path: &PathBuf| path.strip_prefix(&self.out).unwrap_or(path).display().to_string();
        Ok(written.iter().map(inside).collect())
    }

    fn print(&self, tables: &[Table], episodes: usize) -> Result<Outcome, Failure> {
        let main = tables.iter().find(|table| table.name == MAIN_TABLE).or(tables.first());
        let mut out = io::stdout().lock();
        if let Some(table) = main {
            out.write_all(terminal::render(table, terminal_now()).as_bytes())?;
        }
        writeln!(io::stderr(), "{episodes} episodes; tables, cells and provenance are in {}", self.out.display())?;
        Ok(Outcome::Done)
    }
}

/// What standard output is.
fn terminal_now() -> Terminal {
    let is_terminal = io::stdout().is_terminal();
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let width = terminal_size::terminal_size().map(|(width, _)| usize::from(width.0));
    Terminal {
        width: if is_terminal { width } else { None },
        emphasis: if is_terminal && !plain { Marks::Ansi } else { Marks::Signs },
    }
}
