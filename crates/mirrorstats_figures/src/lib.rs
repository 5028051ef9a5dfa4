//! Figures: from cells to one SVG, and from that SVG to PNG and PDF.
//!
//! Rule: a figure reads only [`Input`]: cells, the episode table and the other fields. The same input gives the same
//! bytes. Every data mark is a `<g class="mark">` with a title for hovering and its full values as `data-*` attributes.
//! Missing values are shown as missing, never as zero.

#![warn(clippy::print_stdout, clippy::print_stderr)]

#[cfg(feature = "raster")]
pub mod contact_sheet;
pub mod e5_outcomes;
pub mod film_strip;
pub mod gaze;
pub mod kit;
pub mod shown;

mod completion_gap;
mod decision_curve;
mod dose_response;
mod error;
mod figure;
mod forest;
mod heatmap;
mod intervals;
mod matrix;
mod missing;
mod scatter;
mod slopes;
mod spider;
mod width;

pub use error::FigureError;
pub use figure::{EncodeError, Figure, FigureFormat, UnknownEnding};
pub use kit::lettering::style_sheet as font_style_sheet;
pub use shown::FigureName;
pub use width::{FigureWidth, InvalidWidth};

use e5_outcomes::Outcomes;
use kit::lettering::FULL_WIDTH;
use kit::{Roster, Sheet, label, lettering};
use matrix::{Matrix, MetricId};
use mirrorstats_analysis::statistics::Statistics;
use mirrorstats_score::cells::Cells;
use mirrorstats_score::tables::table::EpisodeTable;
use mirrorstats_score::timeline::Timeline;
use shown::{FigureSheets, SHOWN};

#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    pub cells: &'a Cells,
    /// Models in display order, a style's `row_order`; other models follow in the palette's order, then by name.
    pub order: &'a [String],
    pub sheets: &'a FigureSheets,
    /// One row per episode, for `decision-curve`.
    pub episodes: Option<&'a EpisodeTable>,
    /// Endings of episodes of an open question, for `e5-outcomes`.
    pub outcomes: Option<&'a Outcomes>,
    /// Landmarks of each episode, for `gaze`.
    pub timelines: Option<&'a [Timeline]>,
    /// The statistics of the same episodes, for `forest`.
    pub statistics: Option<&'a Statistics>,
    /// The printed width; `None` for the width as drawn.
    pub width: Option<FigureWidth>,
}

impl<'a> Input<'a> {
    /// Only cells: enough for all figures except `forest`, `decision-curve`, `e5-outcomes` and `gaze`.
    pub fn of_cells(cells: &'a Cells) -> Self {
        let (episodes, outcomes, timelines, statistics) = (None, None, None, None);
        Self { cells, order: &[], sheets: &SHOWN, episodes, outcomes, timelines, statistics, width: None }
    }
}

pub fn draw(name: FigureName, input: &Input<'_>) -> Result<Figure, FigureError> {
    let matrix = Matrix::new(input.cells)?;
    let roster = Roster::new(&matrix.models, input.order);
    let metrics = shown::metrics(name, &matrix, input.sheets)?;
    let width = input.width.map_or(FULL_WIDTH, FigureWidth::layout);
    let scene = Scene { matrix: &matrix, roster: &roster, metrics: &metrics, width };
    let missing = |needed| FigureError::MissingInput { figure: name, needed };
    let (sheet, height) = match name {
        FigureName::Spider => spider::draw(scene),
        FigureName::Heatmap => heatmap::draw(scene),
        FigureName::Scatter => scatter::draw(scene),
        FigureName::CompletionGap => completion_gap::draw(scene),
        FigureName::Intervals => intervals::draw(scene),
        FigureName::Forest => forest::draw(scene, input.statistics.ok_or_else(|| missing("the statistics"))?)?,
        FigureName::Slopes => slopes::draw(scene)?,
        FigureName::DoseResponse => dose_response::draw(scene)?,
        FigureName::E5Outcomes => {
            e5_outcomes::draw(scene, input.outcomes.ok_or_else(|| missing("the outcomes of an open question"))?)
        }
        FigureName::DecisionCurve => {
            decision_curve::draw(scene, input.episodes.ok_or_else(|| missing("the episode table"))?)?
        }
        FigureName::Gaze => {
            let found = input.episodes.map_or(0, EpisodeTable::len);
            let timelines = input.timelines.ok_or_else(|| match gaze::MOST_EPISODES {
                most if found > most => FigureError::TooManyEpisodes { figure: name, most, found },
                _ => missing("the steps of each episode"),
            });
            gaze::draw(scene, timelines?)
        }
    };
    let too_narrow = |least| FigureError::TooNarrow { figure: name, least };
    let printed = input.width.map(|width| width.printed(sheet.width).map_err(too_narrow)).transpose()?;
    let title = shown::title(name, &metrics, matrix.catalog());
    let mut figure = Figure::new(sheet, height, &title, shown::caption(name, &metrics, input.sheets));
    figure.models = matrix.models.len();
    figure.printed = printed;
    Ok(figure)
}

#[derive(Clone, Copy, Debug)]
struct Scene<'a> {
    matrix: &'a Matrix<'a>,
    roster: &'a Roster<'a>,
    metrics: &'a [MetricId<'a>],
    width: f64,
}

impl Scene<'_> {
    /// The names of the models in at most `room` px, and the width of the widest.
    fn row_labels(&self, room: f64) -> (Vec<String>, f64) {
        let lettering = lettering::label();
        let labels = label::fitted(&self.roster.names(), room.min(self.width / 3.0), lettering);
        let width = lettering.widest(&labels);
        (labels, width)
    }
}

/// A drawn sheet and the height to cut it at, px.
type Drawn = (Sheet, f64);
