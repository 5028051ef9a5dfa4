//! `mirrorstats figure NAME TRACES...`: one figure, to a file or standard output.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::cli::args::{EngineArgs, GroupingArgs, ScoringArgs, TraceArgs};
use crate::cli::{Failure, Outcome, output};
use mirrorstats_figures::{FigureFormat, FigureName, FigureWidth};
use mirrorstats_study::{FigureOptions, MANY_MODELS};

/// Draw one figure.
#[derive(Clone, Debug, clap::Args)]
pub struct FigureArgs {
    /// The figure: spider, heatmap, scatter, completion-gap, e5-outcomes, intervals, slopes, dose-response,
    /// decision-curve, gaze
    #[arg(value_name = "NAME")]
    pub name: FigureName,
    #[command(flatten)]
    pub traces: TraceArgs,
    #[command(flatten)]
    pub scoring: ScoringArgs,
    #[command(flatten)]
    pub engine: EngineArgs,
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
    /// The file format [default: by the ending of FILE; svg on standard output]
    #[arg(long, value_parser = formats())]
    pub format: Option<FigureFormat>,
    /// The file to write [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Allow episodes with different settings in one cell
    #[arg(long)]
    pub pool: bool,
}

impl FigureArgs {
    pub fn run(self) -> Result<Outcome, Failure> {
        // Refuse an unknown extension before a pass over the traces.
        let format = self.format()?;
        let grouping = GroupingArgs { pool: self.pool, ..GroupingArgs::default() };
        let study = self.traces.study_on(&self.engine, &self.scoring, &grouping)?;
        if let Some(path) = &self.output {
            output::check_target(path, study.files_read(Some(&self.style)))?;
        }
        let Self { style, metric: metrics, width, top, .. } = self;
        let top = top.map(usize::from);
        let figure = study.figure(self.name, &FigureOptions { style, metrics, width, top })?;
        if top.is_none() && figure.models() > MANY_MODELS {
            output::say(&format!("note: {} models in one figure; --top 12 draws the best 12", figure.models()));
        }
        let bytes = format.encode(&figure).map_err(Failure::input)?;
        match &self.output {
            Some(path) => output::write_file(path, &bytes).map(|()| Outcome::Done),
            None => output::plain(bytes),
        }
    }

    fn format(&self) -> Result<FigureFormat, Failure> {
        match (self.format, &self.output) {
            (Some(format), _) => Ok(format),
            (None, Some(path)) => {
                let hint = |error| Failure::input(format!("{error}; say which one with --format"));
                FigureFormat::from_path(path).map_err(hint)
            }
            (None, None) => Ok(FigureFormat::Svg),
        }
    }
}

fn formats() -> impl TypedValueParser<Value = FigureFormat> {
    let value = |format: &FigureFormat| {
        let help = match format {
            FigureFormat::Svg => "Vectors for the web, values on hover",
            #[cfg(feature = "raster")]
            FigureFormat::Png => "Pixels, about 300 per inch at a width of 7 inches",
            #[cfg(feature = "raster")]
            FigureFormat::Pdf => "Vectors for LaTeX",
        };
        PossibleValue::new(format.ending()).help(help)
    };
    let values = PossibleValuesParser::new(FigureFormat::ALL.iter().map(value));
    values.map(|ending| {
        let format = FigureFormat::ALL.iter().find(|format| format.ending() == ending);
        *format.expect("only endings of formats are possible")
    })
}
