//! From the episode table to what figures are drawn from.

use std::num::NonZeroUsize;

use super::args::ScoringArgs;
use super::outcome::Failure;
use super::scoring;
use crate::cells::cell::Cells;
use crate::cells::group::{DEFAULT_BY, group};
use crate::metric::definitions::Definitions;
use crate::report::figures::e5_outcomes::Outcomes;
use crate::report::figures::{self, Figure, FigureError, FigureName, Input, gaze};
use crate::report::style::Style;
use crate::score::score_traces::ScoreError;
use crate::score::table::EpisodeTable;
use crate::score::timeline::{self, Timeline};
use crate::trace::inputs;
use crate::trace::open::TraceSet;

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
    /// Groups the episodes as figures show them, and reads what `names` need of the steps if they come from traces.
    ///
    /// # Errors
    /// What is wrong with the traces or the definitions.
    pub fn of(
        inputs: &[inputs::Input],
        asked: &ScoringArgs,
        episodes: &'a EpisodeTable,
        style: &'a Style,
        names: &[FigureName],
        threads: NonZeroUsize,
    ) -> Result<Self, Failure> {
        let cells = group(episodes, &DEFAULT_BY.map(str::to_owned)).map_err(Failure::input)?;
        let (timelines, outcomes) = if scoring::are_scores(inputs) {
            (None, None)
        } else {
            let traces = scoring::open(inputs)?;
            // Neither needs a metric, and so no column that only a metric left out would read.
            let definitions = scoring::definitions(&traces, asked)?;
            steps_of(&traces, &definitions, episodes, names, threads).map_err(scoring::score_failure)?
        };
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

/// What figures of these names need of the steps: timelines of as many episodes as a raster shows, and how open
/// questions ended.
///
/// `None` for what the definitions do not name, and for what no figure would show.
fn steps_of(
    traces: &TraceSet,
    definitions: &Definitions,
    episodes: &EpisodeTable,
    names: &[FigureName],
    threads: NonZeroUsize,
) -> Result<(Option<Vec<Timeline>>, Option<Outcomes>), ScoreError> {
    let shows_each = names.contains(&FigureName::Gaze) && episodes.len() <= gaze::MOST_EPISODES;
    let shows_ends = names.contains(&FigureName::E5Outcomes) && Outcomes::are_there(episodes);
    let timelines = if shows_each { timeline::timelines(traces, definitions, threads)? } else { None };
    let answered = match &timelines {
        Some(timelines) => Some(timelines.iter().map(|timeline| timeline.answered).collect()),
        None if shows_ends => timeline::answered(traces, definitions, &episodes.keys, threads)?,
        None => None,
    };
    let outcomes = answered.and_then(|answered: Vec<bool>| Outcomes::of(episodes, &answered));
    Ok((timelines, outcomes))
}
