//! `sensitivity`: each metric as a function of the threshold of mirror evidence, per experiment, one line per model.
//!
//! Reports do not draw it, so it is not in [`crate::FigureName::ALL`].

use indexmap::IndexSet;

use crate::kit::{
    Arrangement, FULL_WIDTH, Frame, MARGIN, Member, Panels, Plot, Point, Roster, Sheet, Swatch, Tick, dodge, legend,
    lettering, many, marker, panels, rate_ticks, whole_ticks,
};
use crate::matrix::{Matrix, MetricId};
use crate::{Drawn, Figure, FigureError};
use mirrorstats_metric::catalogs::catalog::Kind;
use mirrorstats_score::cells::Cells;

const TITLE: &str = "Sensitivity to the threshold of mirror evidence";
const CAPTION: &str = "Each metric under rising thresholds of mirror evidence, one line per model; the first column is the \
                       definitions as they are. Models with the same value stand side by side. Where a metric is undefined \
                       there is no marker, and the line has a gap.";

const MOST_COLUMNS: usize = 5;
const PLOT_HEIGHT: f64 = 92.0;
const AXIS_ROOM: f64 = 24.0;
const AXIS_BELOW: f64 = 28.0;
const GAP: f64 = 12.0;
/// The distance between the markers of models with equal values, px.
const APART: f64 = 4.5;
/// The share of a column that markers side by side may take.
const COLUMN_ROOM: f64 = 0.66;
/// The overhang of the last number beyond its plot, px.
const OVERHANG: f64 = 4.0;
/// The gap between two numbers below a plot, px.
const NUMBER_GAP: f64 = 3.0;

#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// The threshold, px; `None` for the unchanged definitions.
    pub px: Option<u32>,
    pub cells: &'a Cells,
}

#[derive(Clone, Copy, Debug)]
pub struct SensitivityInput<'a> {
    /// The unchanged definitions, then the thresholds, ascending.
    pub stages: &'a [Stage<'a>],
    pub metrics: &'a [String],
    /// Models in display order; other models follow in the palette's order, then by name.
    pub order: &'a [String],
    /// The meaning of a null threshold: `recorded (60 px)`.
    pub reference: &'a str,
}

pub fn draw(input: &SensitivityInput<'_>) -> Result<Figure, FigureError> {
    let (sheet, height) = SensitivityChart::of(input)?.draw();
    Ok(Figure::new(sheet, height, TITLE, CAPTION))
}

struct SensitivityChart<'a> {
    input: &'a SensitivityInput<'a>,
    matrices: Vec<Option<Matrix<'a>>>,
    experiments: Vec<&'a str>,
    roster: Roster<'a>,
    columns: usize,
}

impl<'a> SensitivityChart<'a> {
    fn of(input: &'a SensitivityInput<'a>) -> Result<Self, FigureError> {
        let matrix = |stage: &Stage<'a>| match Matrix::new(stage.cells) {
            Ok(matrix) => Ok(Some(matrix)),
            Err(FigureError::NoEpisodes) => Ok(None),
            Err(other) => Err(other),
        };
        let matrices: Vec<Option<Matrix<'a>>> = input.stages.iter().map(matrix).collect::<Result<_, _>>()?;
        let experiments: IndexSet<&str> =
            matrices.iter().flatten().flat_map(|matrix| matrix.experiments.iter().copied()).collect();
        let mut experiments: Vec<&str> = experiments.into_iter().collect();
        let models: Vec<&str> = matrices.iter().flatten().flat_map(|matrix| matrix.models.iter().copied()).collect();
        let catalog = &input.stages.first().ok_or(FigureError::NoEpisodes)?.cells.catalog;
        experiments.sort_by_key(|name| catalog.experiment_rank(name));
        if experiments.is_empty() {
            return Err(FigureError::NoEpisodes);
        }
        let columns = columns(experiments.len(), input.metrics.len());
        Ok(Self { input, matrices, experiments, roster: Roster::new(&models, input.order), columns })
    }

    fn draw(&self) -> Drawn {
        let panels: Vec<SensitivityPanel<'_, 'a>> =
            self.input.metrics.iter().flat_map(|metric| self.row(metric)).collect();
        let names = panels.iter().map(|panel| format!("{} · {}", panel.experiment, panel.metric));
        let names: Vec<String> = names.collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let gap = if self.shares_axes() { GAP } else { GAP + AXIS_ROOM };
        let arranged =
            Arrangement { left: MARGIN + AXIS_ROOM, columns: self.columns, height: PLOT_HEIGHT + AXIS_BELOW, gap };
        let places = Panels::new(&names, &[], FULL_WIDTH, arranged);
        let mut sheet = places.sheet(FULL_WIDTH);
        for (at, (panel, body)) in panels.iter().zip(&places.bodies).enumerate() {
            let has_numbers = !self.shares_axes() || at % self.columns == 0;
            panel.draw(&mut sheet, Frame { height: PLOT_HEIGHT, ..*body }, has_numbers);
        }
        let height = legend::around(&mut sheet, &self.roster, &places, Swatch::Line, self.signs());
        (sheet, height)
    }

    fn shares_axes(&self) -> bool {
        self.columns == self.experiments.len()
    }

    fn row<'f>(&'f self, metric: &'f str) -> Vec<SensitivityPanel<'f, 'a>> {
        let top = self.top(metric);
        self.experiments.iter().map(|experiment| SensitivityPanel { field: self, experiment, metric, top }).collect()
    }

    /// The largest mean of a quantity in any panel; `None` for a rate.
    fn top(&self, metric: &str) -> Option<f64> {
        let ids = self.matrices.iter().flatten().filter_map(|matrix| Some((matrix, id(matrix, metric)?)));
        let mut top: Option<f64> = None;
        for (matrix, id) in ids.filter(|(_, id)| id.metric.kind == Kind::Quantity) {
            let means = matrix.pairs().filter_map(|(experiment, model)| matrix.reading(experiment, model, id).mean());
            top = Some(means.fold(top.unwrap_or(1.0), f64::max));
        }
        top
    }

    fn label(&self, stage: &Stage<'_>) -> String {
        stage.px.map_or_else(|| short(self.input.reference), |px| px.to_string())
    }

    /// The distance between thresholds in a plot of `width` px; the ends keep half of it, or room for the last number.
    fn column(&self, width: f64) -> f64 {
        let last = self.input.stages.last().map_or(0.0, |stage| lettering::tick().width(&self.label(stage)));
        let count = self.input.stages.len();
        let rim = (width / many(count) / 2.0).max(last / 2.0 - OVERHANG);
        (width - 2.0 * rim) / many(count.max(2) - 1)
    }

    fn signs(&self) -> Vec<(Swatch, String)> {
        vec![
            (Swatch::None, format!("{}: {}", short(self.input.reference), self.input.reference)),
            (Swatch::None, "no marker: undefined".to_owned()),
        ]
    }
}

/// The number of columns: one per experiment if there are several, so that a row is one metric.
fn columns(experiments: usize, metrics: usize) -> usize {
    match experiments {
        1 => panels::balanced(metrics, 3),
        2 if metrics > 1 => 4,
        count => panels::balanced(count, MOST_COLUMNS),
    }
}

fn short(reference: &str) -> String {
    reference.chars().take(3).chain(['.']).collect()
}

fn id<'m>(matrix: &Matrix<'m>, name: &str) -> Option<MetricId<'m>> {
    matrix.metrics().into_iter().find(|metric| metric.name == name)
}

struct SensitivityPanel<'f, 'a> {
    field: &'f SensitivityChart<'a>,
    experiment: &'a str,
    metric: &'f str,
    top: Option<f64>,
}

impl SensitivityPanel<'_, '_> {
    fn draw(&self, sheet: &mut Sheet, frame: Frame, has_numbers: bool) {
        let y = self.top.map_or(-0.05..1.05, |top| -0.05 * top..1.05 * top);
        let column = self.field.column(frame.width);
        let rim = (frame.width / column - many(self.field.input.stages.len() - 1)) / 2.0;
        let plot = Plot::new(frame, -rim..many(self.field.input.stages.len() - 1) + rim, y);
        plot.x_axis(sheet, &self.numbers_below(column));
        plot.x_title(sheet, "threshold, px");
        plot.y_axis(sheet, &self.numbers_beside(has_numbers));
        let stages = self.places(&plot);
        let of_member = |at: usize| stages.iter().map(|places| places[at]).collect::<Vec<_>>();
        for (at, member) in self.field.roster.0.iter().enumerate() {
            self.line(sheet, *member, &of_member(at));
        }
        for (at, member) in self.field.roster.0.iter().enumerate() {
            self.markers(sheet, *member, &of_member(at));
        }
    }

    fn numbers_below(&self, column: f64) -> Vec<Tick> {
        let stages = self.field.input.stages;
        let mut ticks: Vec<Tick> = (0..stages.len()).map(|at| Tick { at: many(at), text: String::new() }).collect();
        let mut taken: Vec<(f64, f64)> = Vec::new();
        for at in [0].into_iter().chain(stages.len().checked_sub(1)).chain(1..stages.len().saturating_sub(1)) {
            let text = self.field.label(&stages[at]);
            let (middle, half) = (column * many(at), lettering::tick().width(&text) / 2.0 + NUMBER_GAP / 2.0);
            let (left, right) = (middle - half, middle + half);
            if taken.iter().all(|(from, to)| right <= *from || *to <= left) {
                taken.push((left, right));
                ticks[at].text = text;
            }
        }
        ticks
    }

    fn numbers_beside(&self, has_numbers: bool) -> Vec<Tick> {
        let mut ticks = match self.top {
            None => rate_ticks(),
            Some(top) => whole_ticks(ceiling(top), 4),
        };
        ticks.retain(|tick| self.top.is_none_or(|top| tick.at <= top * 1.05));
        if !has_numbers {
            for tick in &mut ticks {
                tick.text.clear();
            }
        }
        ticks
    }

    fn mean(&self, stage: usize, model: &str) -> Option<f64> {
        let matrix = self.field.matrices[stage].as_ref()?;
        matrix.reading(self.experiment, model, id(matrix, self.metric)?).mean()
    }

    fn places(&self, plot: &Plot) -> Vec<Vec<Option<Point>>> {
        let members = &self.field.roster.0;
        let room = self.field.column(plot.frame.width) * COLUMN_ROOM;
        let of_stage = |stage: usize| {
            let means: Vec<Option<f64>> = members.iter().map(|member| self.mean(stage, member.model)).collect();
            let exact: Vec<Point> = means.iter().flatten().map(|mean| plot.at(many(stage), *mean)).collect();
            let mut apart = dodge::abreast(&exact, APART, room).into_iter();
            means.iter().map(|mean| mean.and_then(|_| apart.next())).collect()
        };
        (0..self.field.input.stages.len()).map(of_stage).collect()
    }

    fn line(&self, sheet: &mut Sheet, member: Member<'_>, places: &[Option<Point>]) {
        let stages = self.field.input.stages;
        let tried: Vec<Option<Point>> =
            places.iter().zip(stages).filter(|(_, stage)| stage.px.is_some()).map(|(place, _)| *place).collect();
        for run in tried.split(Option::is_none).filter(|run| run.len() > 1) {
            let corners: Vec<Point> = run.iter().copied().flatten().collect();
            sheet.line(&corners, member.style.stroke(1.2));
        }
    }

    fn markers(&self, sheet: &mut Sheet, member: Member<'_>, places: &[Option<Point>]) {
        for (stage, place) in places.iter().enumerate() {
            let (Some(place), Some(matrix)) = (place, &self.field.matrices[stage]) else { continue };
            let Some(id) = id(matrix, self.metric) else { continue };
            let threshold = self.field.input.stages[stage].px;
            let threshold = threshold.map_or_else(|| self.field.input.reference.to_owned(), |px| format!("{px} px"));
            let reading = matrix.reading(self.experiment, member.model, id);
            let mark = reading.mark(self.experiment, member.model, self.metric).with("threshold", threshold);
            sheet.mark(&mark, |sheet| marker::draw(sheet, *place, 2.3, member.style));
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` clamps, and steps are few")]
fn ceiling(value: f64) -> u32 {
    value.ceil() as u32
}
