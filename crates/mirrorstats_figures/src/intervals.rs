//! `intervals`: a rate of each model with its 95 % interval, counts and the level of chance, per experiment.

use crate::kit::{
    Arrangement, Frame, MARGIN, Mark, Member, PALETTE, Panels, Plot, Sheet, Stroke, Swatch, TextAnchor, legend,
    lettering, many, marker, panels, rate_ticks, tiles,
};
use crate::matrix::{MetricId, Reading};
use crate::{Drawn, Scene};
use mirrorstats_exact::number;
use mirrorstats_statistics::intervals::interval::Interval;

const ROW: f64 = 18.0;
const MOST_COLUMNS: usize = 5;
const LEAST_PANEL: f64 = 80.0;
const GAP: f64 = 12.0;
const AXIS_BELOW: f64 = 28.0;

pub fn draw(scene: Scene<'_>) -> Drawn {
    let Scene { matrix, roster, metrics, width } = scene;
    let metric = metrics[0];
    let (labels, label_width) = tiles::row_labels(&roster.names(), scene.name_room());
    let left = MARGIN + label_width + 22.0;
    let room = width - MARGIN - left;
    let columns = panels::fitting(matrix.experiments.len(), MOST_COLUMNS, room, [LEAST_PANEL, GAP]);
    let rows_height = ROW * many(labels.len());
    let arranged = Arrangement { left, columns, height: rows_height + AXIS_BELOW, gap: GAP };
    let panels = Panels::new(&matrix.experiments, &[], width, arranged);
    let mut sheet = panels.sheet(width);
    for first in panels.bodies.iter().step_by(columns) {
        for (row, (member, label)) in roster.0.iter().zip(&labels).enumerate() {
            let middle = first.top + ROW * (many(row) + 0.5);
            sheet.text((MARGIN, middle), label, lettering::label());
            marker::draw(&mut sheet, (left - 10.0, middle), 3.0, member.style);
        }
    }
    let counts = counts_width(scene, metric);
    for (experiment, body) in matrix.experiments.iter().zip(&panels.bodies) {
        let frame = Frame { width: body.width - counts - 8.0, height: rows_height, ..*body };
        let plot = Plot::new(frame, -0.02..1.02, 0.0..1.0);
        Panel { scene, experiment, metric, plot, right: body.right() }.draw(&mut sheet);
    }
    let bottom = legend::draw_signs(&mut sheet, (MARGIN, panels.bottom + 8.0), signs(scene, metric));
    (sheet, bottom + MARGIN)
}

fn counts_width(scene: Scene<'_>, metric: MetricId<'_>) -> f64 {
    let texts = scene.matrix.pairs().map(|(e, m)| counts(scene.matrix.reading(e, m, metric)));
    texts.map(|text| lettering::tick().width(&text)).fold(0.0, f64::max)
}

fn counts(reading: Reading) -> String {
    match reading {
        Reading::Empty => "none".to_owned(),
        Reading::Undefined(_) => "--".to_owned(),
        Reading::Known(moments) => format!("{}/{}", moments.sum, moments.n),
    }
}

fn signs(scene: Scene<'_>, metric: MetricId<'_>) -> Vec<(Swatch, String)> {
    let matrix = scene.matrix;
    let mut signs = vec![(Swatch::None, format!("{} with its Wilson 95 % interval", metric.name))];
    if matrix.experiments.iter().any(|e| matrix.chance(e, metric).is_some()) {
        signs.push((Swatch::Rule(chance_rule()), "chance level".to_owned()));
    }
    for experiment in &matrix.experiments {
        let levels: Vec<_> = matrix.references(experiment, metric).into_iter().map(|(text, _)| text).collect();
        if !levels.is_empty() {
            let words = format!("reference levels in {experiment}: {}", levels.join(", "));
            signs.push((Swatch::Rule(reference_rule()), words));
        }
    }
    let readings: Vec<_> = matrix.pairs().map(|(e, m)| matrix.reading(e, m, metric)).collect();
    let has_empty = readings.iter().any(|reading| matches!(reading, Reading::Empty));
    let has_undefined = readings.iter().any(|reading| matches!(reading, Reading::Undefined(_)));
    let words = [(has_empty, "none: no episodes"), (has_undefined, "--: undefined")];
    signs.extend(words.into_iter().filter(|(is_seen, _)| *is_seen).map(|(_, text)| (Swatch::None, text.to_owned())));
    signs
}

fn chance_rule() -> Stroke {
    Stroke { color: PALETTE.surface.chance, width: 1.2, dash: &[4.0, 2.0] }
}

fn reference_rule() -> Stroke {
    Stroke { color: PALETTE.surface.reference, width: 1.0, dash: &[1.0, 2.0] }
}

struct Panel<'a> {
    scene: Scene<'a>,
    experiment: &'a str,
    metric: MetricId<'a>,
    plot: Plot,
    right: f64,
}

impl Panel<'_> {
    fn draw(&self, sheet: &mut Sheet) {
        self.plot.x_axis(sheet, &rate_ticks());
        self.plot.x_title(sheet, self.metric.name);
        let matrix = self.scene.matrix;
        for (_, level) in matrix.references(self.experiment, self.metric) {
            self.level(sheet, level, reference_rule(), "reference");
        }
        if let Some(level) = matrix.chance(self.experiment, self.metric) {
            self.level(sheet, level, chance_rule(), "chance");
        }
        for (row, member) in self.scene.roster.0.iter().enumerate() {
            self.row(sheet, *member, self.plot.frame.top + ROW * (many(row) + 0.5));
        }
    }

    fn level(&self, sheet: &mut Sheet, level: f64, stroke: Stroke, name: &'static str) {
        let mark = Mark::new(format!("{}: {name} level {}", self.experiment, number::full_precision(level)))
            .with("experiment", self.experiment)
            .number(name, Some(level));
        let x = self.plot.at(level, 0.0).0;
        let frame = self.plot.frame;
        sheet.mark(&mark, |sheet| sheet.line(&[(x, frame.top), (x, frame.bottom())], stroke));
    }

    fn row(&self, sheet: &mut Sheet, member: Member<'_>, middle: f64) {
        let reading = self.scene.matrix.reading(self.experiment, member.model, self.metric);
        let interval = reading.wilson();
        let mark = reading
            .mark(self.experiment, member.model, self.metric.name)
            .number("low", interval.map(|interval| interval.low))
            .number("high", interval.map(|interval| interval.high));
        let stroke = Stroke::solid(member.style.color, 1.6);
        sheet.mark(&mark, |sheet| {
            if let Some(Interval { low, high }) = interval {
                let x = |share| self.plot.at(share, 0.0).0;
                sheet.line(&[(x(low), middle), (x(high), middle)], stroke);
                for end in [x(low), x(high)] {
                    sheet.line(&[(end, middle - 3.0), (end, middle + 3.0)], stroke);
                }
            }
            if let Some(mean) = reading.mean() {
                marker::draw(sheet, (self.plot.at(mean, 0.0).0, middle), 3.2, member.style);
            }
            sheet.text((self.right, middle), &counts(reading), lettering::tick().aligned(TextAnchor::End));
        });
    }
}
