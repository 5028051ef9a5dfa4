//! Figures: from cells to one SVG, and from that SVG to PNG and PDF.
//!
//! Rule: a figure reads cells, the episode table and what else [`Input`] holds, and nothing besides; the same
//! input gives the same bytes. Every mark of data is a `<g class="mark">` with a title for the reader who hovers
//! and its values in full as `data-*` attributes. What is missing is shown as missing, never as zero.
//!
//! One file a figure. The shared parts, from the ground up: `font` and `palette` (what is embedded), `ink` (the
//! backend under `plotters`), `sheet` and `mark` (verbs to draw with), `matrix` and `roster` (the data, and who is
//! who), `plot`, `panels`, `tiles`, `marker`, `dodge`, `legend`, `strip` and `label` (what figures are made of), and
//! `convert` (PNG and PDF, feature `raster`).

pub mod e5_outcomes;
pub mod film_strip;
pub mod gaze;

mod completion_gap;
#[cfg(feature = "raster")]
pub mod convert;
mod decision_curve;
mod dodge;
mod font;
mod format;
mod frame;
mod heatmap;
mod ink;
mod intervals;
mod label;
mod legend;
mod lettering;
mod mark;
mod marker;
mod matrix;
mod palette;
mod panels;
mod plot;
mod roster;
mod scatter;
mod sheet;
mod slopes;
mod spider;
mod strip;
mod tiles;

pub use format::{EncodeError, FigureFormat, UnknownEnding};

use std::fmt;
use std::str::FromStr;

#[cfg(feature = "raster")]
pub use convert::ConvertError;

use crate::base::near;
use crate::cells::cell::Cells;
use crate::score::table::EpisodeTable;
use crate::score::timeline::Timeline;
use e5_outcomes::Outcomes;
use matrix::Matrix;
use roster::Roster;
use sheet::{Drawing, Sheet};

/// The empty rim of every figure, px.
const MARGIN: f64 = 8.0;

/// What figures are drawn from.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The cells by experiment and model.
    pub cells: &'a Cells,
    /// Models in the order to show them, a style's `row_order`; those not named follow in the palette's order, then by name.
    pub order: &'a [String],
    /// One row an episode: for `decision-curve`.
    pub episodes: Option<&'a EpisodeTable>,
    /// How episodes of an open question ended: for `e5-outcomes`.
    pub outcomes: Option<&'a Outcomes>,
    /// Landmarks of each episode: for `gaze`.
    pub timelines: Option<&'a [Timeline]>,
}

impl<'a> Input<'a> {
    /// Cells and nothing else: enough for all figures but `decision-curve`, `e5-outcomes` and `gaze`.
    pub const fn of_cells(cells: &'a Cells) -> Self {
        Self { cells, order: &[], episodes: None, outcomes: None, timelines: None }
    }
}

/// The figures there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FigureName {
    /// Behavioural profiles: a radar an experiment, a line a model.
    Spider,
    /// Models by experiments and metrics, coloured by goodness.
    Heatmap,
    /// Task success against self-attribution.
    Scatter,
    /// Completion-conditioned success minus success.
    CompletionGap,
    /// Final self-identification of the open-ended experiment.
    E5Outcomes,
    /// Task success with its interval and the level of chance.
    Intervals,
    /// Task success from the first experiment to each other.
    Slopes,
    /// The share of episodes decided by step t.
    DecisionCurve,
    /// When the mirror was in view, episode by episode.
    Gaze,
}

impl FigureName {
    /// All figures, in the order of a report.
    pub const ALL: [Self; 9] = [
        Self::Spider,
        Self::Heatmap,
        Self::Scatter,
        Self::CompletionGap,
        Self::E5Outcomes,
        Self::Intervals,
        Self::Slopes,
        Self::DecisionCurve,
        Self::Gaze,
    ];

    /// The name of its file, without the ending.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Spider => "spider",
            Self::Heatmap => "heatmap",
            Self::Scatter => "scatter",
            Self::CompletionGap => "completion-gap",
            Self::E5Outcomes => "e5-outcomes",
            Self::Intervals => "intervals",
            Self::Slopes => "slopes",
            Self::DecisionCurve => "decision-curve",
            Self::Gaze => "gaze",
        }
    }

    /// What it is called, for headings and for those who do not see it.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Spider => "Behavioural profiles",
            Self::Heatmap => "Performance across experiments and metrics",
            Self::Scatter => "Task success against self-attribution",
            Self::CompletionGap => "Completion gap",
            Self::E5Outcomes => "Final self-identification outcomes",
            Self::Intervals => "Task success with 95 % intervals",
            Self::Slopes => "Task success from experiment to experiment",
            Self::DecisionCurve => "Share of episodes decided by step t",
            Self::Gaze => "Mirror in view, episode by episode",
        }
    }

    /// One or two sentences on how to read it.
    pub const fn caption(self) -> &'static str {
        match self {
            Self::Spider => {
                "One line a model, further out is better on every axis: rates where less is better are shown as one \
                 minus the rate, durations reversed and scaled between the least and the greatest mean of their \
                 experiment, a half where all are equal. The red mark on the TSA axis is the level of chance."
            }
            Self::Heatmap => {
                "Numbers are means. Colours are set so that darker is better: rates where less is better from one \
                 minus the rate, durations reversed and scaled within their experiment."
            }
            Self::Scatter => {
                "One point a model and experiment; on the dashed diagonal TSA equals CAAL. Larger markers are slower \
                 decisions (TTD against the slowest model of the experiment). Models with the same values are fanned \
                 out around the place they share."
            }
            Self::CompletionGap => {
                "TSA among episodes that end with a decision, minus TSA among all: what is lost by not deciding."
            }
            Self::E5Outcomes => {
                "Episodes whose final self-attribution was correct, was another colour, or was unknown or never given."
            }
            Self::Intervals => {
                "TSA with its Wilson 95 % interval and counts. The red line is the level of chance, dotted lines are \
                 reference levels where no level of chance applies."
            }
            Self::Slopes => {
                "TSA of each model in the first experiment and in each other one. Models with the same value stand \
                 side by side."
            }
            Self::DecisionCurve => {
                "Kaplan-Meier estimate of the share of episodes decided by step t; episodes that end undecided are \
                 censored there (upright ticks)."
            }
            Self::Gaze => {
                "One row an episode, sorted by length within its model; the mirror in view, first sight of it, the \
                 first claim of a colour and the decision."
            }
        }
    }
}

impl fmt::Display for FigureName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FigureName {
    type Err = FigureError;

    fn from_str(text: &str) -> Result<Self, FigureError> {
        Self::ALL.into_iter().find(|figure| figure.name() == text).ok_or_else(|| {
            let known = Self::ALL.map(Self::name);
            let nearest = near::nearest(text, known).map(|name| format!("; did you mean `{name}`?"));
            FigureError::UnknownFigure {
                name: text.to_owned(),
                known: known.join(", "),
                hint: nearest.unwrap_or_default(),
            }
        })
    }
}

/// A figure that cannot be drawn from what there is.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// A name that is no figure's.
    #[error("expected the name of a figure ({known}), found `{name}`{hint}")]
    UnknownFigure {
        /// What was found.
        name: String,
        /// The names there are.
        known: String,
        /// The nearest one, as a question.
        hint: String,
    },
    /// Cells that are not one an experiment and model.
    #[error("figures need cells by experiment and model, found cells by `{found}`; leave out `--by`")]
    Grouping {
        /// The keys found.
        found: String,
    },
    /// No cell at all.
    #[error("there is no episode to draw; check the traces and `--where`")]
    NoEpisodes,
    /// A metric that the definitions lack.
    #[error(
        "figure `{figure}` needs the metric {metric}, found {known}; include the paper's definitions in the \
         definition file"
    )]
    UnknownMetric {
        /// The figure.
        figure: &'static str,
        /// What it needs.
        metric: String,
        /// What there is.
        known: String,
    },
    /// An input that was not given.
    #[error("figure `{figure}` needs {needed}; draw it from traces that have such episodes, not from scores alone")]
    MissingInput {
        /// The figure.
        figure: FigureName,
        /// What it needs.
        needed: &'static str,
    },
    /// More episodes than a figure shows one by one.
    #[error(
        "figure `{figure}` shows each episode and at most {most} of them, found {found}; choose some with --where, such \
         as --where \"run = 1\""
    )]
    TooManyEpisodes {
        /// The figure.
        figure: FigureName,
        /// How many it shows.
        most: usize,
        /// How many there are.
        found: usize,
    },
    /// A figure of changes between experiments, and only one experiment.
    #[error("figure `slopes` needs two experiments or more, found {found}; add traces of another one")]
    OneExperiment {
        /// The experiment found.
        found: String,
    },
}

/// A drawn figure.
#[derive(Clone, Debug)]
pub struct Figure {
    drawing: Drawing,
}

impl Figure {
    /// A document of its own: the font is inside.
    pub fn svg(&self) -> String {
        self.drawing.document(&font::style_sheet())
    }

    /// An `<svg>` element to set into HTML, which brings [`font_style_sheet`] along once for all figures.
    pub fn inline_svg(&self) -> String {
        self.drawing.inline()
    }

    /// The picture as PNG.
    ///
    /// # Errors
    /// When there is no room for the pixels.
    #[cfg(feature = "raster")]
    pub fn png(&self) -> Result<Vec<u8>, ConvertError> {
        convert::png(&convert::tree(&self.inline_svg())?)
    }

    /// The picture as a PDF of one page.
    ///
    /// # Errors
    /// When the page is too large for a PDF.
    #[cfg(feature = "raster")]
    pub fn pdf(&self) -> Result<Vec<u8>, ConvertError> {
        convert::pdf(&convert::tree(&self.inline_svg())?)
    }
}

/// The style sheet with the figures' font, for a page that has [`Figure::inline_svg`] in it.
pub fn font_style_sheet() -> String {
    font::style_sheet()
}

/// Draws a figure.
///
/// # Errors
/// When the input lacks what the figure needs.
pub fn draw(name: FigureName, input: &Input<'_>) -> Result<Figure, FigureError> {
    let matrix = Matrix::new(input.cells)?;
    let roster = Roster::new(&matrix.models, input.order);
    let scene = Scene { matrix: &matrix, roster: &roster };
    let missing = |needed| FigureError::MissingInput { figure: name, needed };
    let (sheet, height) = match name {
        FigureName::Spider => spider::draw(scene)?,
        FigureName::Heatmap => heatmap::draw(scene),
        FigureName::Scatter => scatter::draw(scene)?,
        FigureName::CompletionGap => completion_gap::draw(scene)?,
        FigureName::Intervals => intervals::draw(scene)?,
        FigureName::Slopes => slopes::draw(scene)?,
        FigureName::E5Outcomes => {
            e5_outcomes::draw(scene, input.outcomes.ok_or_else(|| missing("the outcomes of an open question"))?)
        }
        FigureName::DecisionCurve => {
            decision_curve::draw(scene, input.episodes.ok_or_else(|| missing("the episode table"))?)?
        }
        FigureName::Gaze => {
            let found = input.episodes.map_or(0, EpisodeTable::len);
            let most = gaze::MOST_EPISODES;
            if input.timelines.is_none() && found > most {
                return Err(FigureError::TooManyEpisodes { figure: name, most, found });
            }
            gaze::draw(scene, input.timelines.ok_or_else(|| missing("the steps of each episode"))?)
        }
    };
    Ok(Figure { drawing: sheet.finish(height, name.title(), name.caption()) })
}

/// What every figure is drawn from.
#[derive(Clone, Copy, Debug)]
struct Scene<'a> {
    matrix: &'a Matrix<'a>,
    roster: &'a Roster<'a>,
}

/// A drawn sheet and the height to cut it at, px.
type Drawn = (Sheet, f64);
