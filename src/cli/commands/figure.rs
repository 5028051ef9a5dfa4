//! `mirrorstats figure NAME TRACES...`: one figure, to a file or to standard output.

use std::ffi::OsStr;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use clap::ValueEnum;

use crate::cli::args::{EngineArgs, ScoringArgs, TraceArgs};
use crate::cli::drawing::Sources;
use crate::cli::empty_filter;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::scoring;
use crate::report::figures::{self, Figure, FigureName, Input};
use crate::report::style::Style;

/// Draw one figure.
#[derive(Clone, Debug, clap::Args)]
pub struct FigureArgs {
    /// Which: spider, heatmap, scatter, completion-gap, e5-outcomes, intervals, slopes, decision-curve, gaze
    #[arg(value_name = "NAME")]
    pub name: FigureName,
    /// The traces to draw it from.
    #[command(flatten)]
    pub traces: TraceArgs,
    /// How the metrics are defined.
    #[command(flatten)]
    pub scoring: ScoringArgs,
    /// What computes it.
    #[command(flatten)]
    pub engine: EngineArgs,
    /// The style whose order of models is taken: `default`, `paper`, or a TOML file
    #[arg(long, value_name = "STYLE", default_value = "default")]
    pub style: String,
    /// The file format [default: by the ending of FILE; svg on standard output]
    #[arg(long, value_enum)]
    pub format: Option<Format>,
    /// Where to write it [default: standard output]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// The formats of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Vectors for the web, values on hover.
    Svg,
    /// Pixels, about 300 an inch at a width of 7 inches.
    #[cfg(feature = "raster")]
    Png,
    /// Vectors for LaTeX.
    #[cfg(feature = "raster")]
    Pdf,
}

impl Format {
    /// The ending of a file of this format.
    pub(crate) const fn ending(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            #[cfg(feature = "raster")]
            Self::Png => "png",
            #[cfg(feature = "raster")]
            Self::Pdf => "pdf",
        }
    }

    /// The format that the ending of `path` asks for, SVG where there is no ending.
    fn of(path: &Path) -> Result<Self, UnknownEnding> {
        let Some(ending) = path.extension().and_then(OsStr::to_str) else { return Ok(Self::Svg) };
        Self::from_str(ending, true).map_err(|_| UnknownEnding { ending: ending.to_owned() })
    }

    #[cfg_attr(
        not(feature = "raster"),
        expect(clippy::unnecessary_wraps, reason = "without the converters nothing can fail")
    )]
    pub(crate) fn encode(self, figure: &Figure) -> Result<Vec<u8>, Failure> {
        match self {
            Self::Svg => Ok(figure.svg().into_bytes()),
            #[cfg(feature = "raster")]
            Self::Png => figure.png().map_err(Failure::input),
            #[cfg(feature = "raster")]
            Self::Pdf => figure.pdf().map_err(Failure::input),
        }
    }
}

impl FigureArgs {
    /// Scores the traces and draws.
    ///
    /// # Errors
    /// Whatever is wrong with the traces, the definitions, the style or the output.
    pub fn run(self) -> Result<Outcome, Failure> {
        let style = Style::load(&self.style).map_err(Failure::input)?;
        let inputs = scoring::resolve(&self.traces)?;
        if let Some(path) = &self.output {
            let named = [self.scoring.definitions.as_deref(), Some(self.style.as_str())];
            output::check_target(path, output::files_read(&inputs, &named))?;
        }
        let threads = self.traces.threads.count();
        let episodes = scoring::table_on(&self.engine, &inputs, &self.scoring, &[], threads)?;
        empty_filter::check(episodes.len(), &inputs, &self.scoring, threads)?;
        let sources = Sources::of(&inputs, &self.scoring, &episodes, &style, &[self.name], threads)?;
        self.write(&sources.input())
    }

    /// Draws the figure from `input` and writes it where it was asked for.
    ///
    /// # Errors
    /// When the input lacks what the figure needs, and when the file cannot be written.
    pub fn write(&self, input: &Input<'_>) -> Result<Outcome, Failure> {
        let format = self.format().map_err(Failure::input)?;
        let figure = figures::draw(self.name, input).map_err(Failure::input)?;
        let bytes = format.encode(&figure)?;
        match &self.output {
            Some(path) => output::write_file(path, &bytes)?,
            None => io::stdout().lock().write_all(&bytes)?,
        }
        Ok(Outcome::Done)
    }

    fn format(&self) -> Result<Format, UnknownEnding> {
        match (self.format, &self.output) {
            (Some(format), _) => Ok(format),
            (None, Some(path)) => Format::of(path),
            (None, None) => Ok(Format::Svg),
        }
    }
}

/// A file whose ending is no format of a figure.
#[derive(Debug, thiserror::Error)]
#[error("expected a file that ends in {}, found the ending `{ending}`; say which one with --format", endings())]
struct UnknownEnding {
    ending: String,
}

fn endings() -> String {
    let names = Format::value_variants().iter().filter_map(Format::to_possible_value);
    names.map(|name| format!(".{}", name.get_name())).collect::<Vec<_>>().join(", ")
}

#[cfg(all(test, feature = "raster"))]
mod tests {
    use std::path::Path;

    use super::Format;

    #[test]
    fn the_ending_decides_and_a_strange_one_is_refused() {
        for (name, format) in
            [("a.svg", Format::Svg), ("b/c.PNG", Format::Png), ("d.pdf", Format::Pdf), ("e", Format::Svg)]
        {
            assert_eq!(Format::of(Path::new(name)).unwrap(), format);
        }
        assert_eq!(
            Format::of(Path::new("f.jpg")).unwrap_err().to_string(),
            "expected a file that ends in .svg, .png, .pdf, found the ending `jpg`; say which one with --format"
        );
    }
}
