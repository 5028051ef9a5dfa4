//! `completion-gap`: a rate among finished episodes minus the rate among all, models by experiments.

use crate::kit::lettering::NAME_ROOM;
use crate::kit::{
    Frame, MARGIN, Mark, PALETTE, Rgb, Sheet, TextAnchor, label, leading, legend, lettering, many, tiles,
};
use crate::matrix::{MetricId, Value};
use crate::{Drawn, Scene, missing};
use mirrorstats_exact::number::Decimal;

const ROW: f64 = 20.0;
const CELL: f64 = 50.0;
const LEAST_CELL: f64 = 34.0;
/// Room for the scale below, px.
const LEAST_WIDTH: f64 = 400.0;

pub fn draw(scene: Scene<'_>) -> Drawn {
    let Scene { matrix, roster, width: all, .. } = scene;
    let gaps = Gaps::new(scene);
    let (labels, label_width) = scene.row_labels(NAME_ROOM);
    let left = MARGIN + label_width + 8.0;
    let columns = many(matrix.experiments.len());
    let cell = ((all - MARGIN - left) / columns).clamp(LEAST_CELL, CELL);
    let width = (left + cell * columns + MARGIN).max(LEAST_WIDTH.min(all));
    let cell = (width - MARGIN - left) / columns;
    let mut sheet = Sheet::new(width);
    let rows = MARGIN + leading(lettering::heading()) + 4.0;
    let heading = lettering::heading().aligned(TextAnchor::Middle);
    for (column, name) in label::fitted(&matrix.experiments, cell - 2.0, heading).iter().enumerate() {
        let at = (left + cell * (many(column) + 0.5), MARGIN + leading(heading) / 2.0);
        sheet.text(at, name, heading);
    }
    for (row, (member, label)) in roster.0.iter().zip(&labels).enumerate() {
        let top = rows + ROW * many(row);
        sheet.text((MARGIN, top + ROW / 2.0), label, lettering::label());
        for (column, experiment) in matrix.experiments.iter().enumerate() {
            let frame = Frame::new(left + cell * many(column), top, cell, ROW).inset(0.5);
            gaps.draw(&mut sheet, experiment, member.model, frame);
        }
    }
    let height = gaps.draw_key(&mut sheet, rows + ROW * many(labels.len()) + 10.0);
    (sheet, height)
}

/// The gaps of all cells, the largest absolute gap, and whether any is negative.
struct Gaps<'a> {
    scene: Scene<'a>,
    ids: [MetricId<'a>; 2],
    largest: f64,
    has_fall: bool,
}

impl<'a> Gaps<'a> {
    fn new(scene: Scene<'a>) -> Self {
        let mut gaps = Self { scene, ids: [scene.metrics[0], scene.metrics[1]], largest: 0.0, has_fall: false };
        for (gap, _) in scene.matrix.pairs().filter_map(|(e, m)| gaps.gap(e, m)).collect::<Vec<_>>() {
            gaps.largest = gaps.largest.max(gap.abs());
            gaps.has_fall |= gap < 0.0;
        }
        gaps
    }

    /// The gap, and its exact value with two decimal places and a sign.
    fn gap(&self, experiment: &str, model: &str) -> Option<(f64, String)> {
        let [finished, all] = self.ids.map(|id| self.scene.matrix.reading(experiment, model, id).moments());
        let (finished, all) = (finished?, all?);
        let (a, b) = (i128::from(finished.n), i128::from(all.n));
        let above = finished.sum.checked_mul(b)?.checked_sub(all.sum.checked_mul(a)?)?;
        let gap = Decimal::of_ratio(above, a.checked_mul(b)?, 2)?.to_string();
        let text = match gap.strip_prefix('-') {
            Some(size) => format!("−{size}"),
            None if gap == "0.00" => gap,
            None => format!("+{gap}"),
        };
        Some((finished.mean()? - all.mean()?, text))
    }

    fn color(&self, gap: f64) -> Rgb {
        let ramp = if gap < 0.0 { &PALETTE.ramp.fall } else { &PALETTE.ramp.rise };
        ramp.at(if self.largest > 0.0 { gap.abs() / self.largest } else { 0.0 })
    }

    fn draw(&self, sheet: &mut Sheet, experiment: &str, model: &str, frame: Frame) {
        let [finished, all] = self.ids.map(|id| self.scene.matrix.reading(experiment, model, id));
        let (gap, text) = self.gap(experiment, model).unzip();
        let words = text.as_deref().unwrap_or("undefined");
        let [among, whole] = self.ids.map(|id| id.name);
        let parts = format!("{among}: {}, {whole}: {}", finished.words(), all.words());
        let title = format!("{experiment} · {model} · {among} − {whole}: {words} · {parts}");
        let mark = Mark::of_cell(title, experiment, model, &format!("{among} - {whole}"))
            .value(gap)
            .with("n", all.n())
            .with("n-finished", finished.n());
        sheet.mark(&mark, |sheet| match (all.value, gap) {
            (Value::Empty, _) => tiles::empty(sheet, frame),
            (_, None) => tiles::undefined(sheet, frame),
            (_, Some(gap)) => tiles::known(sheet, frame, self.color(gap), text.as_slice()),
        });
    }

    fn draw_key(&self, sheet: &mut Sheet, top: f64) -> f64 {
        let size = Decimal::of_float(self.largest, 2).map(|size| size.to_string()).unwrap_or_default();
        let low = if self.has_fall { -self.largest } else { 0.0 };
        let low_text = if self.has_fall { format!("−{size}") } else { "0".to_owned() };
        let color = |share: f64| self.color(low + (self.largest - low) * share);
        let scale = tiles::scale(sheet, (MARGIN, top), color, [&low_text, &format!("+{size}")]);
        let matrix = self.scene.matrix;
        let readings = matrix.pairs().flat_map(|(e, m)| self.ids.map(|id| matrix.reading(e, m, id)));
        legend::draw_signs(sheet, (scale + 24.0, top), missing::signs(readings, missing::TILES)).max(top + 14.0)
            + MARGIN
    }
}
