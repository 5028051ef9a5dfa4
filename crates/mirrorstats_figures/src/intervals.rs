//! `intervals`: a rate of each model with its 95 % interval, counts and the level of chance, per experiment.

use crate::kit::lettering::NAME_ROOM;
use crate::kit::{
    Frame, Grid, MARGIN, Mark, PALETTE, Plot, ROOM_BELOW, Sheet, Stroke, Swatch, TextAnchor, legend, lettering, many,
    marker, rate_ticks,
};
use crate::matrix::{MetricId, Reading, Value};
use crate::{Drawn, Scene, missing};
use mirrorstats_exact::number;

const ROW: f64 = 18.0;
const MOST_COLUMNS: usize = 5;
const LEAST_PANEL: f64 = 80.0;
const GAP: f64 = 12.0;

pub fn draw(scene: Scene<'_>) -> Drawn {
    let Scene { matrix, roster, metrics, width } = scene;
    let metric = metrics[0];
    let (labels, label_width) = scene.row_labels(NAME_ROOM);
    let left = MARGIN + label_width + 22.0;
    let grid = Grid { width, left, gap: GAP, columns: MOST_COLUMNS };
    let grid = grid.at_least(LEAST_PANEL).balanced(matrix.experiments.len());
    let rows_height = ROW * many(labels.len());
    let (mut sheet, panels) = grid.panels(&matrix.experiments, &[], rows_height + ROOM_BELOW);
    for first in panels.bodies.iter().step_by(grid.columns) {
        for (row, (member, label)) in roster.0.iter().zip(&labels).enumerate() {
            let middle = first.top + ROW * (many(row) + 0.5);
            sheet.text((MARGIN, middle), label, lettering::label());
            marker::draw(&mut sheet, (left - 10.0, middle), 3.0, member.style);
        }
    }
    let counts = matrix.pairs().map(|(e, m)| counts(matrix.reading(e, m, metric)));
    let counts = lettering::tick().widest(counts);
    for (experiment, body) in matrix.experiments.iter().zip(&panels.bodies) {
        let frame = Frame { width: body.width - counts - 8.0, height: rows_height, ..*body };
        let plot = Plot::new(frame, -0.02..1.02, 0.0..1.0);
        panel(&mut sheet, &plot, scene, experiment, body.right());
    }
    let bottom = legend::draw_signs(&mut sheet, (MARGIN, panels.bottom + 8.0), signs(scene, metric));
    (sheet, bottom + MARGIN)
}

fn counts(reading: Reading<'_>) -> String {
    match reading.value {
        Value::Empty => "none".to_owned(),
        Value::Undefined(_) => "--".to_owned(),
        Value::Known { moments, .. } => format!("{}/{}", moments.sum, moments.n),
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
    let readings = matrix.pairs().map(|(e, m)| matrix.reading(e, m, metric));
    let absent = missing::signs(readings, [(Swatch::None, "--: undefined"), (Swatch::None, "none: no episodes")]);
    signs.extend(absent.into_iter().rev());
    signs
}

fn chance_rule() -> Stroke {
    Stroke { color: PALETTE.surface.chance, width: 1.2, dash: &[4.0, 2.0] }
}

fn reference_rule() -> Stroke {
    Stroke { color: PALETTE.surface.reference, width: 1.0, dash: &[1.0, 2.0] }
}

fn panel(sheet: &mut Sheet, plot: &Plot, scene: Scene<'_>, experiment: &str, right: f64) {
    let (matrix, metric, frame) = (scene.matrix, scene.metrics[0], plot.frame);
    plot.x_axis(sheet, &rate_ticks(), metric.name);
    let references = matrix.references(experiment, metric).into_iter();
    let references = references.map(|(_, level)| (level, reference_rule(), "reference"));
    let chance = matrix.chance(experiment, metric).map(|level| (level, chance_rule(), "chance"));
    for (level, stroke, name) in references.chain(chance) {
        let mark = Mark::new(format!("{experiment}: {name} level {}", number::full_precision(level)))
            .with("experiment", experiment)
            .number(name, Some(level));
        let x = plot.x(level);
        sheet.mark(&mark, |sheet| sheet.line(&[(x, frame.top), (x, frame.bottom())], stroke));
    }
    for (row, member) in scene.roster.0.iter().enumerate() {
        let middle = frame.top + ROW * (many(row) + 0.5);
        let reading = matrix.reading(experiment, member.model, metric);
        let bounds = reading.wilson();
        let stroke = Stroke::solid(member.style.color, 1.6);
        sheet.mark(&reading.mark().interval(bounds), |sheet| {
            if let Some(bounds) = bounds {
                let ends = [bounds.low, bounds.high].map(|share| plot.x(share));
                sheet.line(&ends.map(|x| (x, middle)), stroke);
                for end in ends {
                    sheet.line(&[(end, middle - 3.0), (end, middle + 3.0)], stroke);
                }
            }
            if let Some(mean) = reading.mean() {
                marker::draw(sheet, (plot.x(mean), middle), 3.2, member.style);
            }
            sheet.text((right, middle), &counts(reading), lettering::tick().aligned(TextAnchor::End));
        });
    }
}
