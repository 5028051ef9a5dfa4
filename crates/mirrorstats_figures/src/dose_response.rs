//! `dose-response`: a rate of each model, with its 95 % interval, against the dose of each factor.

use crate::kit::{
    Frame, Grid, MARGIN, Mark, Member, Plot, Point, ROOM_BELOW, ROOM_LEFT, Sheet, Stroke, Swatch, Tick, legend,
    lettering, many, marker, rate_ticks,
};
use crate::{Drawn, FigureError, Scene};
use mirrorstats_exact::number;
use mirrorstats_metric::catalogs::catalog::Factor;

const MOST_COLUMNS: usize = 2;
const LEAST_PANEL: f64 = 190.0;
const PLOT_HEIGHT: f64 = 190.0;
/// The distance between the markers of two models at one dose, px.
const APART: f64 = 5.0;

pub fn draw(scene: Scene<'_>) -> Result<Drawn, FigureError> {
    let Scene { matrix, roster, metrics, width } = scene;
    let shown: Vec<Shown<'_>> =
        matrix.catalog().factor.iter().filter_map(|(name, it)| Shown::of(scene, name, it)).collect();
    if shown.is_empty() {
        return Err(FigureError::NoFactor { found: matrix.experiments.join(", ") });
    }
    let grid = Grid { width, left: MARGIN + ROOM_LEFT, gap: ROOM_LEFT + 8.0, columns: MOST_COLUMNS };
    let names: Vec<&str> = shown.iter().map(|factor| factor.name).collect();
    let (mut sheet, panels) =
        grid.at_least(LEAST_PANEL).balanced(names.len()).panels(&names, &[], PLOT_HEIGHT + ROOM_BELOW);
    for (factor, body) in shown.iter().zip(&panels.bodies) {
        let last = factor.at(factor.doses.len() - 1);
        let margin = (last - factor.at(0)) * 0.06;
        let frame = Frame { height: PLOT_HEIGHT, ..*body };
        let plot = Plot::new(frame, factor.at(0) - margin..last + margin, -0.03..1.03);
        let doses = (&factor.ticks(&plot)[..], &factor.factor.label()[..]);
        plot.axes(&mut sheet, doses, (&rate_ticks(), metrics[0].name));
        for (at, member) in roster.0.iter().enumerate() {
            let step = APART.min(body.width * 0.06 / many(roster.0.len().max(2) - 1));
            let aside = step * (many(at) - many(roster.0.len() - 1) / 2.0);
            line(&mut sheet, &plot, scene, factor, *member, aside);
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
            let (middle, half) = (plot.x(at), lettering::tick().width(&text) / 2.0);
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

/// Draws the line of a model, with its markers `aside` px from the doses.
fn line(sheet: &mut Sheet, plot: &Plot, scene: Scene<'_>, factor: &Shown<'_>, member: Member<'_>, aside: f64) {
    let point = |at: usize| {
        let (experiment, dose) = factor.doses[at];
        let reading = scene.matrix.reading(experiment, member.model, scene.metrics[0]);
        let (x, y) = plot.at(factor.at(at), reading.mean()?);
        Some((dose, reading, (x + aside, y)))
    };
    let points: Vec<_> = (0..factor.doses.len()).filter_map(point).collect();
    let places: Vec<Point> = points.iter().map(|(.., place)| *place).collect();
    if places.len() > 1 {
        let title = format!("{} · {}", factor.name, member.model);
        sheet.mark(&Mark::new(title), |sheet| sheet.line(&places, member.style.stroke(1.3)));
    }
    for (dose, reading, (x, y)) in points {
        let bounds = reading.wilson();
        let mark = reading.mark().with("factor", factor.name).number("dose", Some(dose)).interval(bounds);
        sheet.mark(&mark, |sheet| {
            if let Some(bounds) = bounds {
                let ends = [bounds.low, bounds.high].map(|share| (x, plot.y(share)));
                sheet.line(&ends, Stroke::solid(member.style.color, 1.0));
            }
            marker::draw(sheet, (x, y), 3.0, member.style);
        });
    }
}
