//! From the episode table to what figures are drawn from.

use std::num::NonZeroUsize;

use super::args::ScoringArgs;
use super::outcome::Failure;
use super::scoring;
use crate::cells::cell::Cells;
use crate::cells::group::{DEFAULT_BY, group};
use crate::report::figures::e5_outcomes::Outcomes;
use crate::report::figures::{self, Figure, FigureError, FigureName, Input};
use crate::report::style::Style;
use crate::score::table::EpisodeTable;
use crate::score::timeline::{self, Timeline};
use crate::trace::inputs;

/// The most episodes that are drawn one by one.
const MOST_EPISODES: usize = 2_000;

/// Everything that figures may need.
#[derive(Debug)]
pub struct Sources<'a> {
    cells: Cells,
    order: &'a [String],
    episodes: &'a EpisodeTable,
    timelines: Option<Vec<Timeline>>,
    outcomes: Option<Outcomes>,
}

/// The figures of a report.
#[derive(Debug, Default)]
pub struct Drawings {
    /// Those that can be drawn.
    pub drawn: Vec<(FigureName, Figure)>,
    /// Why each other one cannot.
    pub left_out: Vec<(FigureName, FigureError)>,
}

impl<'a> Sources<'a> {
    /// Groups the episodes as figures show them, and reads their timelines if they come from traces.
    ///
    /// # Errors
    /// What is wrong with the traces or the definitions.
    pub fn of(
        inputs: &[inputs::Input],
        asked: &ScoringArgs,
        episodes: &'a EpisodeTable,
        style: &'a Style,
        threads: NonZeroUsize,
    ) -> Result<Self, Failure> {
        let cells = group(episodes, &DEFAULT_BY.map(str::to_owned)).map_err(Failure::input)?;
        let timelines = timelines(inputs, asked, episodes, threads)?;
        let outcomes = timelines.as_deref().and_then(|timelines| Outcomes::of(episodes, timelines));
        Ok(Self { cells, order: &style.sheet.row_order, episodes, timelines, outcomes })
    }

    /// What one figure is drawn from.
    pub fn input(&self) -> Input<'_> {
        Input {
            cells: &self.cells,
            order: self.order,
            episodes: Some(self.episodes),
            outcomes: self.outcomes.as_ref(),
            timelines: self.timelines.as_deref(),
        }
    }

    /// Every figure that can be drawn, and why each other one cannot.
    pub fn draw_all(&self) -> Drawings {
        let mut drawings = Drawings::default();
        for name in FigureName::ALL {
            match figures::draw(name, &self.input()) {
                Ok(figure) => drawings.drawn.push((name, figure)),
                Err(error) => drawings.left_out.push((name, error)),
            }
        }
        drawings
    }
}

/// `None` for scores, for definitions that do not name the moments, and for more episodes than a raster can show.
fn timelines(
    inputs: &[inputs::Input],
    asked: &ScoringArgs,
    episodes: &EpisodeTable,
    threads: NonZeroUsize,
) -> Result<Option<Vec<Timeline>>, Failure> {
    if episodes.len() > MOST_EPISODES || scoring::are_scores(inputs) {
        return Ok(None);
    }
    let traces = scoring::open(inputs)?;
    // Timelines need no metric, and so no column that only a metric left out would read.
    let definitions = scoring::definitions(&traces, asked)?;
    timeline::timelines(&traces, &definitions, threads).map_err(scoring::score_failure)
}
