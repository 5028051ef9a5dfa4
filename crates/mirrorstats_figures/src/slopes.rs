//! `slopes`: a rate of each model from the first experiment to every other.

use crate::kit::{
    Frame, Grid, Legend, MARGIN, Mark, Plot, Point, Sheet, Swatch, TextAnchor, dodge, label, leading, lettering,
    marker, rate_ticks,
};
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
    let grid = Grid { width: all, left: MARGIN + AXIS_ROOM, gap: GAP, columns: MOST_COLUMNS };
    let grid = grid.at_least(LEAST_PANEL).balanced(others.len());
    let strip = |e| Strip::new(scene, e, &[metric], grid.panel() / 2.0 - 4.0);
    let strips: Vec<_> = others.iter().map(|other| [strip(first), strip(other)]).collect();
    let strip_height = strips.iter().flatten().map(|strip| strip.height).fold(0.0, f64::max);
    let height = PLOT_HEIGHT + label_room() + strip_height;
    let (mut sheet, panels) = grid.panels(others, &matrix.titles(others), height);
    for (at, ((other, body), strips)) in others.iter().zip(&panels.bodies).zip(&strips).enumerate() {
        let plot = Plot::new(Frame { height: PLOT_HEIGHT, ..*body }, 0.0..1.0, -0.03..1.03);
        axis(&mut sheet, &plot, at % grid.columns, metric.name);
        slopes(&mut sheet, &plot, scene, [first, other]);
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
    plot.y_ticks(sheet, &ticks);
}

fn slopes(sheet: &mut Sheet, plot: &Plot, scene: Scene<'_>, experiments: [&str; 2]) {
    let (frame, members) = (plot.frame, &scene.roster.0);
    let columns = [frame.left + frame.width * 0.22, frame.left + frame.width * 0.78];
    let lettering = lettering::label().aligned(TextAnchor::Middle);
    let names = label::fitted(&experiments, frame.width / 2.0 - 4.0, lettering);
    for (name, x) in names.iter().zip(columns) {
        sheet.text((x, frame.bottom() + 8.0 + leading(lettering) / 2.0 - 2.0), name, lettering);
    }
    let reading = |side: usize, at: usize| scene.matrix.reading(experiments[side], members[at].model, scene.metrics[0]);
    let mut ends = vec![[None; 2]; members.len()];
    for side in [0, 1] {
        let seen = (0..members.len()).filter_map(|at| Some((at, reading(side, at).mean()?)));
        let (seen, places): (Vec<usize>, Vec<Point>) =
            seen.map(|(at, mean)| (at, (columns[side], plot.y(mean)))).unzip();
        for (at, place) in seen.into_iter().zip(dodge::abreast(&places, 7.0, frame.width * 0.36)) {
            ends[at][side] = Some(place);
        }
    }
    for (member, ends) in members.iter().zip(&ends) {
        let [Some(from), Some(to)] = *ends else { continue };
        let title = format!("{} → {} · {}", experiments[0], experiments[1], member.model);
        sheet.mark(&Mark::new(title), |sheet| sheet.line(&[from, to], member.style.stroke(1.3)));
    }
    for (at, (member, ends)) in members.iter().zip(&ends).enumerate() {
        for (side, place) in ends.iter().enumerate() {
            let Some(place) = *place else { continue };
            sheet.mark(&reading(side, at).mark(), |sheet| marker::draw(sheet, place, 3.0, member.style));
        }
    }
}
