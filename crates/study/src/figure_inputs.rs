//! What figures are drawn from, and the figures of a report.

use std::borrow::Cow;

use super::error::StudyError;
use super::results::Results;
use report::bundle::OutputFile;
use report::cells::Cells;
use report::cells::group::{DEFAULT_BY, group};
use report::figures::{self, Figure, FigureError, FigureFormat, FigureName, Input};
use report::style::Style;

/// What figures are drawn from.
#[derive(Debug)]
pub struct FigureInputs<'a> {
    cells: Cells,
    style: &'a Style,
    results: Cow<'a, Results>,
}

/// The figures of a report.
#[derive(Debug, Default)]
pub struct Drawings {
    /// Those that can be drawn.
    pub drawn: Vec<(FigureName, Figure)>,
    /// Why each other one cannot.
    pub left_out: Vec<(FigureName, FigureError)>,
}

impl<'a> FigureInputs<'a> {
    /// Groups the episodes as figures show them: by experiment and model, a model under another condition as one of its own.
    ///
    /// # Errors
    /// Sums of squares that leave 128 bits.
    pub fn of(results: &'a Results, style: &'a Style) -> Result<Self, StudyError> {
        let results = results.with_conditions_as_models();
        let cells = group(&results.episodes, &DEFAULT_BY.map(str::to_owned))?;
        Ok(Self { cells, style, results })
    }

    /// One figure.
    ///
    /// # Errors
    /// When the inputs lack what the figure needs.
    pub fn draw(&self, name: FigureName) -> Result<Figure, FigureError> {
        figures::draw(name, &self.input())
    }

    /// Every figure that can be drawn, and why each other one cannot.
    pub fn draw_all(&self) -> Drawings {
        let mut drawings = Drawings::default();
        for name in FigureName::ALL {
            match self.draw(name) {
                Ok(figure) => drawings.drawn.push((name, figure)),
                Err(error) => drawings.left_out.push((name, error)),
            }
        }
        drawings
    }

    fn input(&self) -> Input<'_> {
        Input {
            cells: &self.cells,
            order: &self.style.sheet.row_order,
            sheets: &self.style.sheet.figure,
            episodes: Some(&self.results.episodes),
            outcomes: self.results.outcomes.as_ref(),
            timelines: self.results.timelines.as_deref(),
        }
    }
}

impl Drawings {
    /// The figures in every format, as files of a report.
    ///
    /// # Errors
    /// When a picture has no room in memory.
    pub fn files(&self) -> Result<Vec<OutputFile>, StudyError> {
        let mut files = Vec::new();
        for (name, figure) in &self.drawn {
            for format in FigureFormat::ALL {
                let path = format!("figures/{name}.{}", format.ending()).into();
                files.push(OutputFile { path, bytes: format.encode(figure)? });
            }
        }
        Ok(files)
    }
}
