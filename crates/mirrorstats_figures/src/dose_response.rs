//! `dose-response`: a rate of each model, with its 95 % interval, against the dose of each factor.

use crate::kit::{
    Arrangement, Frame, MARGIN, Mark, Member, Panels, Plot, Point, Sheet, Stroke, Swatch, Tick, legend, lettering,
    many, marker, panels, rate_ticks,
};
use crate::matrix::{MetricId, Reading};
use crate::{Drawn, FigureError, Scene};
use mirrorstats_exact::number;
use mirrorstats_metric::catalogs::catalog::Factor;
use mirrorstats_statistics::intervals::interval::Interval;

const MOST_COLUMNS: usize = 2;
const LEAST_PANEL: f64 = 190.0;
const PLOT_HEIGHT: f64 = 190.0;
const AXIS_ROOM: f64 = 34.0;
const AXIS_BELOW: f64 = 28.0;
/// The distance between the markers of two models at one dose, px.
const APART: f64 = 5.0;

pub fn draw(scene: Scene<'_>) -> Result<Drawn, FigureError> {
    let Scene { matrix, roster, metrics, width } = scene;
    let shown: Vec<Shown<'_>> =
        matrix.catalog().factor.iter().filter_map(|(name, it)| Shown::of(scene, name, it)).collect();
    if shown.is_empty() {
        return Err(FigureError::NoFactor { found: matrix.experiments.join(", ") });
    }
    let (gap, left) = (AXIS_ROOM + 8.0, MARGIN + AXIS_ROOM);
    let columns = panels::fitting(shown.len(), MOST_COLUMNS, width - left - MARGIN, [LEAST_PANEL, gap]);
    let arranged = Arrangement { left, columns, height: PLOT_HEIGHT + AXIS_BELOW, gap };
    let names: Vec<&str> = shown.iter().map(|factor| factor.name).collect();
    let panels = Panels::new(&names, &[], width, arranged);
    let mut sheet = panels.sheet(width);
    for (factor, body) in shown.iter().zip(&panels.bodies) {
        let last = factor.at(factor.doses.len() - 1);
        let margin = (last - factor.at(0)) * 0.06;
        let frame = Frame { height: PLOT_HEIGHT, ..*body };
        let plot = Plot::new(frame, factor.at(0) - margin..last + margin, -0.03..1.03);
        plot.x_axis(&mut sheet, &factor.ticks(&plot));
        plot.y_axis(&mut sheet, &rate_ticks());
        plot.x_title(&mut sheet, &factor.factor.label());
        plot.y_title(&mut sheet, metrics[0].name, 26.0);
        for (at, member) in roster.0.iter().enumerate() {
            let step = APART.min(body.width * 0.06 / many(roster.0.len().max(2) - 1));
            let aside = step * (many(at) - many(roster.0.len() - 1) / 2.0);
            Line { scene, metric: metrics[0], factor, member: *member, aside }.draw(&mut sheet, &plot);
        }
    }
    let height = legend::around(&mut sheet, roster, &panels, Swatch::Line, Vec::new());
    Ok((sheet, height))
}

struct Shown<'a> {
    name: &'a str,
    factor: &'a Factor,
    doses: Vec<(&'a str, f64)>,
}

impl<'a> Shown<'a> {
    fn of(scene: Scene<'a>, name: &'a str, factor: &'a Factor) -> Option<Self> {
        let mut doses = factor.doses();
        doses.retain(|(experiment, _)| scene.matrix.experiments.contains(experiment));
        (doses.len() > 1 && doses[0].1 < doses[doses.len() - 1].1).then_some(Self { name, factor, doses })
    }

    /// The position of a dose on the axis: log2(1 + dose), or linear if any dose is negative.
    fn at(&self, dose: usize) -> f64 {
        let value = self.doses[dose].1;
        if self.doses[0].1 >= 0.0 { (1.0 + value).log2() } else { value }
    }

    /// The ticks; a number that would touch the previous one is omitted.
    fn ticks(&self, plot: &Plot) -> Vec<Tick> {
        let mut free = f64::NEG_INFINITY;
        let tick = |dose: usize| {
            let (at, mut text) = (self.at(dose), number::full_precision(self.doses[dose].1));
            let (middle, half) = (plot.at(at, 0.0).0, lettering::tick().width(&text) / 2.0);
            if middle - half < free {
                text.clear();
            } else {
                free = middle + half + 3.0;
            }
            Tick { at, text }
        };
        (0..self.doses.len()).map(tick).collect()
    }
}

struct Line<'a> {
    scene: Scene<'a>,
    metric: MetricId<'a>,
    factor: &'a Shown<'a>,
    member: Member<'a>,
    /// The distance of its markers from the dose, px.
    aside: f64,
}

impl Line<'_> {
    fn draw(&self, sheet: &mut Sheet, plot: &Plot) {
        let points: Vec<(usize, Reading, Point)> =
            (0..self.factor.doses.len()).filter_map(|at| self.point(plot, at)).collect();
        let places: Vec<Point> = points.iter().map(|(.., place)| *place).collect();
        if places.len() > 1 {
            let title = format!("{} · {}", self.factor.name, self.member.model);
            sheet.mark(&Mark::new(title), |sheet| sheet.line(&places, self.member.style.stroke(1.3)));
        }
        for (at, reading, place) in points {
            self.marker(sheet, plot, at, reading, place);
        }
    }

    fn point(&self, plot: &Plot, at: usize) -> Option<(usize, Reading, Point)> {
        let reading = self.scene.matrix.reading(self.factor.doses[at].0, self.member.model, self.metric);
        let (x, y) = plot.at(self.factor.at(at), reading.mean()?);
        Some((at, reading, (x + self.aside, y)))
    }

    fn marker(&self, sheet: &mut Sheet, plot: &Plot, at: usize, reading: Reading, (x, y): Point) {
        let (experiment, dose) = self.factor.doses[at];
        let interval = reading.wilson();
        let mark = reading
            .mark(experiment, self.member.model, self.metric.name)
            .with("factor", self.factor.name)
            .number("dose", Some(dose))
            .number("low", interval.map(|interval| interval.low))
            .number("high", interval.map(|interval| interval.high));
        let stroke = Stroke::solid(self.member.style.color, 1.0);
        sheet.mark(&mark, |sheet| {
            if let Some(Interval { low, high }) = interval {
                sheet.line(&[(x, plot.at(0.0, low).1), (x, plot.at(0.0, high).1)], stroke);
            }
            marker::draw(sheet, (x, y), 3.0, self.member.style);
        });
    }
}
