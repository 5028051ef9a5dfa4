//! `spider`: behavioural profiles, one radar per experiment and one line per model.

use std::f64::consts::TAU;

use crate::kit::marker::polar;
use crate::kit::{
    Grid, MARGIN, Mark, Member, PALETTE, Point, Sheet, Stroke, Swatch, TextAnchor, legend, lettering, many, marker,
};
use crate::matrix::MetricId;
use crate::missing::{self, Strip};
use crate::{Drawn, Scene};
use mirrorstats_metric::catalogs::catalog::{Better, Kind};

const MOST_COLUMNS: usize = 3;
const LEAST_PANEL: f64 = 190.0;
const GAP: f64 = 12.0;
const RADIUS: f64 = 70.0;
/// Room above and below the radar for the labels of its axes, px.
const LABEL_ROOM: f64 = 18.0;

pub fn draw(scene: Scene<'_>) -> Drawn {
    let Scene { matrix, roster, metrics: axes, width } = scene;
    let grid = Grid { width, left: MARGIN, gap: GAP, columns: MOST_COLUMNS }.at_least(LEAST_PANEL);
    let (strips, below) = Strip::of_experiments(scene, axes, grid.panel());
    let titles = matrix.titles(&matrix.experiments);
    let height = 2.0 * (RADIUS + LABEL_ROOM) + below;
    let (mut sheet, panels) = grid.panels(&matrix.experiments, &titles, height);
    for ((experiment, body), strip) in matrix.experiments.iter().zip(&panels.bodies).zip(&strips) {
        Radar { scene, experiment, center: (body.center().0, body.top + RADIUS + LABEL_ROOM) }.draw(&mut sheet);
        strip.draw(&mut sheet, (body.left, body.bottom() - below));
    }
    let signs = signs(scene).into_iter().chain(missing::strip_signs(&strips)).collect();
    let height = legend::around(&mut sheet, roster, &panels, Swatch::Line, signs);
    (sheet, height)
}

fn signs(scene: Scene<'_>) -> Vec<(Swatch, String)> {
    let metric = scene.metrics[0];
    let has_chance = scene.matrix.experiments.iter().any(|e| scene.matrix.chance(e, metric).is_some());
    let chance = has_chance.then(|| (Swatch::Chance, format!("chance level of {}", metric.name)));
    let is_reversed = |id: &&MetricId<'_>| (id.metric.better, id.metric.kind) == (Better::Lower, Kind::Quantity);
    let reversed: Vec<&str> = scene.metrics.iter().filter(is_reversed).map(|id| id.name).collect();
    let reversed = match reversed.as_slice() {
        [] => String::new(),
        names => format!("; {} reversed, from the greatest mean (0) to the least (1)", names.join(", ")),
    };
    chance.into_iter().chain([(Swatch::None, format!("centre 0, outer ring 1{reversed}"))]).collect()
}

struct Radar<'a> {
    scene: Scene<'a>,
    experiment: &'a str,
    center: Point,
}

impl Radar<'_> {
    fn draw(&self, sheet: &mut Sheet) {
        self.web(sheet);
        self.labels(sheet);
        for member in &self.scene.roster.0 {
            self.line(sheet, *member);
        }
        for member in &self.scene.roster.0 {
            self.markers(sheet, *member);
        }
        if let Some(chance) = self.scene.matrix.chance(self.experiment, self.scene.metrics[0]) {
            let mark = Mark::new(format!("{}: chance level of {}", self.experiment, self.scene.metrics[0].name))
                .with("experiment", self.experiment)
                .number("chance", Some(chance));
            sheet.mark(&mark, |sheet| legend::chance(sheet, self.place(0, chance)));
        }
    }

    fn place(&self, axis: usize, share: f64) -> Point {
        let (x, y) = polar(RADIUS * share, self.angle(axis));
        (self.center.0 + x, self.center.1 + y)
    }

    fn angle(&self, axis: usize) -> f64 {
        TAU * many(axis) / many(self.scene.metrics.len())
    }

    fn web(&self, sheet: &mut Sheet) {
        let (axes, surface) = (self.scene.metrics.len(), &PALETTE.surface);
        for (share, color) in [(0.25, surface.rule), (0.5, surface.rule), (0.75, surface.rule), (1.0, surface.axis)] {
            let ring: Vec<Point> = (0..=axes).map(|axis| self.place(axis % axes, share)).collect();
            sheet.line(&ring, Stroke::solid(color, 0.7));
        }
        for axis in 0..axes {
            sheet.line(&[self.center, self.place(axis, 1.0)], Stroke::solid(surface.rule, 0.7));
        }
    }

    fn labels(&self, sheet: &mut Sheet) {
        for (axis, metric) in self.scene.metrics.iter().enumerate() {
            let (x, y) = polar(RADIUS + 9.0, self.angle(axis));
            let align = match x {
                x if x < -1.0 => TextAnchor::End,
                x if x > 1.0 => TextAnchor::Start,
                _ => TextAnchor::Middle,
            };
            let at = (self.center.0 + x, self.center.1 + y);
            sheet.text(at, &axis_label(*metric), lettering::value().aligned(align));
        }
    }

    fn shares(&self, member: Member<'_>) -> Vec<Option<f64>> {
        let share = |metric: &MetricId<'_>| self.scene.matrix.goodness(self.experiment, member.model, *metric);
        self.scene.metrics.iter().map(share).collect()
    }

    fn line(&self, sheet: &mut Sheet, member: Member<'_>) {
        let shares = self.shares(member);
        let mark = Mark::new(format!("{} · {}", self.experiment, member.model));
        let stroke = member.style.stroke(1.3);
        let point = |axis: usize| shares[axis % shares.len()].map(|share| self.place(axis % shares.len(), share));
        let whole: Option<Vec<Point>> = (0..=shares.len()).map(point).collect();
        sheet.mark(&mark, |sheet| {
            if let Some(outline) = whole {
                sheet.line(&outline, stroke);
            } else {
                let sides = (0..shares.len()).filter_map(|axis| Some([point(axis)?, point(axis + 1)?]));
                sides.for_each(|side| sheet.line(&side, stroke));
            }
        });
    }

    fn markers(&self, sheet: &mut Sheet, member: Member<'_>) {
        for (axis, (metric, share)) in self.scene.metrics.iter().zip(self.shares(member)).enumerate() {
            let Some(share) = share else { continue };
            let reading = self.scene.matrix.reading(self.experiment, member.model, *metric);
            sheet.mark(&reading.mark(), |sheet| marker::draw(sheet, self.place(axis, share), 2.6, member.style));
        }
    }
}

fn axis_label(metric: MetricId<'_>) -> String {
    match (metric.metric.better, metric.metric.kind) {
        (Better::Lower, Kind::Rate) => format!("1 − {}", metric.name),
        (Better::Lower, Kind::Quantity) => format!("{} rev.", metric.name),
        (Better::Higher | Better::Neither, _) => metric.name.to_owned(),
    }
}
