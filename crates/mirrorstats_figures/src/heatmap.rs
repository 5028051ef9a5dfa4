//! `heatmap`: models by experiments and metrics; the colour shows how good the mean is, the number is the mean.

use crate::kit::lettering::NAME_ROOM;
use crate::kit::{
    Frame, Grid, Lettering, MARGIN, PALETTE, Sheet, TextAnchor, label, leading, legend, lettering, many, tiles,
};
use crate::matrix::{MetricId, Reading, Value};
use crate::{Drawn, Scene, missing};
use mirrorstats_metric::catalogs::catalog::Kind;

const ROW: f64 = 17.0;
const LEAST_CELL: f64 = 22.0;
const WIDEST_CELL: f64 = 46.0;
const BLOCK_GAP: f64 = 10.0;
const MOST_BLOCKS: usize = 8;
/// Room for the scale and the signs below, px.
const LEAST_WIDTH: f64 = 430.0;

pub fn draw(scene: Scene<'_>) -> Drawn {
    let Scene { matrix, metrics, width: all, .. } = scene;
    let (labels, label_width) = scene.row_labels(NAME_ROOM);
    let left = MARGIN + label_width + 8.0;
    let grid = Grid { width: all, left, gap: BLOCK_GAP, columns: MOST_BLOCKS };
    let grid = grid.at_least(many(metrics.len()) * LEAST_CELL).balanced(matrix.experiments.len());
    let (gaps, cells) = (BLOCK_GAP * many(grid.columns - 1), many((grid.columns * metrics.len()).max(1)));
    let cell = ((all - MARGIN - left - gaps) / cells).clamp(LEAST_CELL, WIDEST_CELL);
    let width = left + (cell * cells + gaps) + MARGIN;
    let head = Head::new(metrics, cell);
    let height = head.height + ROW * many(labels.len());
    let titles = matrix.titles(&matrix.experiments);
    let (mut sheet, panels) = Grid { width, ..grid }.panels(&matrix.experiments, &titles, height);
    sheet.width = width.max(LEAST_WIDTH.min(all));
    for first in panels.bodies.iter().step_by(grid.columns) {
        for (row, label) in labels.iter().enumerate() {
            sheet.text((MARGIN, first.top + head.height + ROW * (many(row) + 0.5)), label, lettering::label());
        }
    }
    for (experiment, body) in matrix.experiments.iter().zip(&panels.bodies) {
        head.draw(&mut sheet, *body);
        draw_block(&mut sheet, scene, experiment, Frame { top: body.top + head.height, ..*body });
    }
    let height = draw_key(&mut sheet, scene, panels.bottom + 12.0);
    (sheet, height)
}

fn draw_key(sheet: &mut Sheet, scene: Scene<'_>, top: f64) -> f64 {
    let Scene { matrix, metrics, .. } = scene;
    let scale = tiles::scale(sheet, (MARGIN, top), |share| PALETTE.ramp.goodness.at(share), ["worse", "better"]);
    let readings = matrix.pairs().flat_map(|(e, m)| metrics.iter().map(move |metric| matrix.reading(e, m, *metric)));
    legend::draw_signs(sheet, (scale + 24.0, top), missing::signs(readings, missing::TILES)).max(top + 14.0) + MARGIN
}

/// The names of the metrics above their columns; vertical if a column is too narrow for any of them.
struct Head<'a> {
    metrics: &'a [MetricId<'a>],
    lettering: Lettering,
    height: f64,
}

impl<'a> Head<'a> {
    fn new(metrics: &'a [MetricId<'a>], cell: f64) -> Self {
        const TALLEST: f64 = 60.0;
        let level = lettering::tick().aligned(TextAnchor::Middle);
        let widest = level.widest(metrics.iter().map(|metric| metric.name));
        if widest <= cell {
            return Self { metrics, lettering: level, height: leading(level) + 2.0 };
        }
        Self { metrics, lettering: level.aligned(TextAnchor::Start).upwards(), height: widest.min(TALLEST) + 5.0 }
    }

    fn draw(&self, sheet: &mut Sheet, body: Frame) {
        let cell = body.width / many(self.metrics.len());
        for (column, metric) in self.metrics.iter().enumerate() {
            let middle = body.left + cell * (many(column) + 0.5);
            let (below, room) = if self.lettering.upwards {
                (self.height - 3.0, self.height - 5.0)
            } else {
                (leading(self.lettering) / 2.0, cell)
            };
            let text = label::cut(metric.name, room, self.lettering);
            sheet.text((middle, body.top + below), &text, self.lettering);
        }
    }
}

fn draw_block(sheet: &mut Sheet, scene: Scene<'_>, experiment: &str, body: Frame) {
    let Scene { matrix, roster, metrics, .. } = scene;
    let cell = body.width / many(metrics.len());
    for (column, &metric) in metrics.iter().enumerate() {
        for (row, member) in roster.0.iter().enumerate() {
            let (left, top) = (body.left + cell * many(column), body.top + ROW * many(row));
            let frame = Frame::new(left, top, cell, ROW).inset(0.5);
            let reading = matrix.reading(experiment, member.model, metric);
            let color = matrix.goodness(experiment, member.model, metric).map(|share| PALETTE.ramp.goodness.at(share));
            sheet.mark(&reading.mark(), |sheet| match (reading.value, color) {
                (Value::Empty, _) => tiles::empty(sheet, frame),
                (_, None) => tiles::undefined(sheet, frame),
                (_, Some(color)) => tiles::known(sheet, frame, color, &texts(reading, metric)),
            });
        }
    }
}

fn texts(reading: Reading<'_>, metric: MetricId<'_>) -> Vec<String> {
    let places: &[u32] = match metric.metric.kind {
        Kind::Rate => &[2, 1],
        Kind::Quantity => &[1, 0],
    };
    places.iter().filter_map(|&places| Some(reading.decimal(places)?.to_string())).collect()
}
