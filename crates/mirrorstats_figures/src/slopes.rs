//! `slopes`: a rate of each model from the first experiment to every other.

use crate::kit::{
    Arrangement, Frame, Legend, MARGIN, Mark, Member, Panels, Plot, Point, Sheet, Swatch, TextAnchor, dodge, label,
    leading, lettering, many, marker, panels, rate_ticks,
};
use crate::matrix::MetricId;
use crate::missing::Strip;
use crate::{Drawn, FigureError, Scene};

const MOST_COLUMNS: usize = 4;
const PLOT_HEIGHT: f64 = 210.0;
const AXIS_ROOM: f64 = 30.0;
const GAP: f64 = 22.0;
const LEAST_PANEL: f64 = 90.0;

pub fn draw(scene: Scene<'_>) -> Result<Drawn, FigureError> {
    let Scene { matrix, roster, metrics, width: all } = scene;
    let metric = metrics[0];
    let (first, others) = match matrix.experiments.as_slice() {
        [first, others @ ..] if !others.is_empty() => (*first, others),
        found => return Err(FigureError::OneExperiment { found: found.join(", ") }),
    };
    let left = MARGIN + AXIS_ROOM;
    let room = all - left - MARGIN;
    let columns = panels::fitting(others.len(), MOST_COLUMNS, room, [LEAST_PANEL, GAP]);
    let width = (room - GAP * many(columns - 1)) / many(columns);
    let strip = |e| Strip::new(matrix, roster, e, &[metric], width / 2.0 - 4.0);
    let strips: Vec<_> = others.iter().map(|other| [strip(first), strip(other)]).collect();
    let strip_height = strips.iter().flatten().map(|strip| strip.height).fold(0.0, f64::max);
    let height = PLOT_HEIGHT + label_room() + strip_height;
    let arranged = Arrangement { left, columns, height, gap: GAP };
    let panels = Panels::new(others, &matrix.titles(others), all, arranged);
    let mut sheet = panels.sheet(all);
    for (at, ((other, body), strips)) in others.iter().zip(&panels.bodies).zip(&strips).enumerate() {
        let plot = Plot::new(Frame { height: PLOT_HEIGHT, ..*body }, 0.0..1.0, -0.03..1.03);
        axis(&mut sheet, &plot, at % columns, metric.name);
        SlopePlot { scene, metric, plot, experiments: [first, other] }.draw(&mut sheet);
        let top = body.top + PLOT_HEIGHT + label_room();
        strips[0].draw(&mut sheet, (body.left, top));
        strips[1].draw(&mut sheet, (body.center().0 + 4.0, top));
    }
    let legend = Legend::of_models(roster, all - 2.0 * MARGIN, Swatch::Line);
    legend.draw(&mut sheet, (MARGIN, panels.bottom + 10.0));
    Ok((sheet, panels.bottom + 10.0 + legend.height + MARGIN))
}

fn label_room() -> f64 {
    8.0 + leading(lettering::label())
}

fn axis(sheet: &mut Sheet, plot: &Plot, column: usize, title: &str) {
    let mut ticks = rate_ticks();
    if column == 0 {
        plot.y_title(sheet, title, 24.0);
    } else {
        for tick in &mut ticks {
            tick.text.clear();
        }
    }
    plot.y_axis(sheet, &ticks);
}

struct SlopePlot<'a> {
    scene: Scene<'a>,
    metric: MetricId<'a>,
    plot: Plot,
    experiments: [&'a str; 2],
}

impl SlopePlot<'_> {
    fn draw(&self, sheet: &mut Sheet) {
        let frame = self.plot.frame;
        let lettering = lettering::label().aligned(TextAnchor::Middle);
        let names = label::fitted(&self.experiments, frame.width / 2.0 - 4.0, lettering);
        for (name, x) in names.iter().zip(self.columns()) {
            sheet.text((x, frame.bottom() + 8.0 + leading(lettering) / 2.0 - 2.0), name, lettering);
        }
        let ends = self.ends();
        for (member, ends) in self.scene.roster.0.iter().zip(&ends) {
            self.line(sheet, *member, *ends);
        }
        for (member, ends) in self.scene.roster.0.iter().zip(&ends) {
            self.markers(sheet, *member, *ends);
        }
    }

    fn columns(&self) -> [f64; 2] {
        let frame = self.plot.frame;
        [frame.left + frame.width * 0.22, frame.left + frame.width * 0.78]
    }

    fn ends(&self) -> Vec<[Option<Point>; 2]> {
        let members = &self.scene.roster.0;
        let mut ends = vec![[None; 2]; members.len()];
        for (side, (experiment, x)) in self.experiments.iter().zip(self.columns()).enumerate() {
            let mean = |m: &Member<'_>| self.scene.matrix.reading(experiment, m.model, self.metric).mean();
            let seen: Vec<_> =
                members.iter().map(mean).enumerate().filter_map(|(at, mean)| Some((at, mean?))).collect();
            let places: Vec<Point> = seen.iter().map(|&(_, mean)| (x, self.plot.at(0.0, mean).1)).collect();
            let room = self.plot.frame.width * 0.36;
            for ((at, _), place) in seen.iter().zip(dodge::abreast(&places, 7.0, room)) {
                ends[*at][side] = Some(place);
            }
        }
        ends
    }

    fn line(&self, sheet: &mut Sheet, member: Member<'_>, ends: [Option<Point>; 2]) {
        let [Some(from), Some(to)] = ends else { return };
        let title = format!("{} → {} · {}", self.experiments[0], self.experiments[1], member.model);
        sheet.mark(&Mark::new(title), |sheet| sheet.line(&[from, to], member.style.stroke(1.3)));
    }

    fn markers(&self, sheet: &mut Sheet, member: Member<'_>, ends: [Option<Point>; 2]) {
        for (experiment, place) in self.experiments.iter().zip(ends) {
            let Some(place) = place else { continue };
            let reading = self.scene.matrix.reading(experiment, member.model, self.metric);
            let mark = reading.mark(experiment, member.model, self.metric.name);
            sheet.mark(&mark, |sheet| marker::draw(sheet, place, 3.0, member.style));
        }
    }
}
