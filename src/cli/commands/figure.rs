//! `mirrorstats figure NAME TRACES...`: one figure, to a file or to standard output.

use std::ffi::OsStr;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use crate::cli::args::TraceArgs;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::report::figures::{self, Figure, FigureName, Input};

/// Draw one figure.
#[derive(Clone, Debug, clap::Args)]
pub struct FigureArgs {
    /// Which: spider, heatmap, scatter, completion-gap, e5-outcomes, intervals, slopes, decision-curve, gaze
    #[arg(value_name = "NAME")]
    pub name: FigureName,
    /// The traces to draw it from.
    #[command(flatten)]
    pub traces: TraceArgs,
    /// The file format [default: by the ending of FILE, else svg]
    #[arg(long, value_enum)]
    pub format: Option<Format>,
    /// Where to write it [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// The formats of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// Vectors for the web, values on hover.
    Svg,
    /// Pixels, about 300 an inch at a width of 7 inches.
    Png,
    /// Vectors for LaTeX.
    Pdf,
}

impl Format {
    /// The format of a file by its ending.
    fn of(path: &Path) -> Option<Self> {
        match path.extension().and_then(OsStr::to_str)?.to_ascii_lowercase().as_str() {
            "svg" => Some(Self::Svg),
            "png" => Some(Self::Png),
            "pdf" => Some(Self::Pdf),
            _ => None,
        }
    }

    fn encode(self, figure: &Figure) -> Result<Vec<u8>, figures::ConvertError> {
        match self {
            Self::Svg => Ok(figure.svg().into_bytes()),
            Self::Png => figure.png(),
            Self::Pdf => figure.pdf(),
        }
    }
}

impl FigureArgs {
    /// Draws the figure from `input` and writes it where it was asked for.
    ///
    /// # Errors
    /// When the input lacks what the figure needs, and when the file cannot be written.
    pub fn write(&self, input: &Input<'_>) -> Result<Outcome, Failure> {
        let figure = figures::draw(self.name, input).map_err(Failure::input)?;
        let bytes = self.format().encode(&figure).map_err(Failure::input)?;
        match &self.output {
            Some(path) => output::write_file(path, &bytes)?,
            None => io::stdout().lock().write_all(&bytes)?,
        }
        Ok(Outcome::Done)
    }

    fn format(&self) -> Format {
        self.format.or_else(|| self.output.as_deref().and_then(Format::of)).unwrap_or(Format::Svg)
    }
}
