//! `mirrorstats figure NAME TRACES...`: one figure, to a file or standard output.

use std::path::PathBuf;

use crate::cli::args::{GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_figures::{FigureFormat, FigureName, FigureWidth};
use mirrorstats_study::figure::{FigureOptions, MANY_MODELS, figure};

/// Draw one figure.
#[derive(Clone, Debug, clap::Args)]
pub struct FigureArgs {
    /// The figure: spider, heatmap, scatter, completion-gap, e5-outcomes, intervals, forest, slopes, dose-response,
    /// decision-curve, gaze
    #[arg(value_name = "NAME")]
    pub name: FigureName,
    #[command(flatten)]
    pub traces: TraceArgs,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// The style that orders the models: `default`, `paper`, or a TOML file
    #[arg(long, value_name = "STYLE", default_value = "default")]
    pub style: PathBuf,
    /// The metrics shown, in the order of their roles, such as CAAL [default: those of the style]
    #[arg(long, value_name = "METRIC", value_delimiter = ',')]
    pub metric: Option<Vec<String>>,
    /// The width on paper, such as 8.5cm or 3.3in, with text of at least 6 pt [default: the drawn width]
    #[arg(long, value_name = "WIDTH")]
    pub width: Option<FigureWidth>,
    /// Draw only the best N models, by the mean of the first metric over all experiments [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub top: Option<u16>,
    /// The file to write: .svg, .png or .pdf [default: SVG on standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Allow episodes with different settings in one cell
    #[arg(long)]
    pub pool: bool,
}

impl FigureArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        // Refuse an unknown extension before a pass over the traces.
        let format = self.output.as_deref().map_or(Ok(FigureFormat::Svg), FigureFormat::from_path)?;
        let grouping = GroupingArgs { pool: self.pool, ..GroupingArgs::default() };
        let study = self.traces.study(&self.scoring, &grouping)?;
        if let Some(path) = &self.output {
            output::check_target(path, study.files_read(Some(&self.style)))?;
        }
        let Self { style, metric: metrics, width, top, .. } = self;
        let top = top.map(usize::from);
        let figure = figure(&study, self.name, &FigureOptions { style, metrics, width, top })?;
        if top.is_none() && figure.models() > MANY_MODELS {
            output::say(&format!("note: {} models in one figure; --top 12 draws the best 12", figure.models()));
        }
        let bytes = format.encode(&figure)?;
        match &self.output {
            Some(path) => output::write_file(path, &bytes).map(|()| Outcome::Done),
            None => output::plain(bytes),
        }
    }
}
