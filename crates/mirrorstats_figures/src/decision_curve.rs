//! `decision-curve`: the Kaplan-Meier estimate of the share of episodes decided by step t.

use std::collections::BTreeMap;

use crate::kit::{
    Fill, Frame, Grid, MARGIN, Mark, Member, PALETTE, Plot, Point, ROOM_BELOW, ROOM_LEFT, Sheet, Stroke, Swatch,
    legend, many, marker, rate_ticks, whole_ticks,
};
use crate::matrix::{CONFIDENCE, MetricId};
use crate::{Drawn, FigureError, FigureName, Scene};
use mirrorstats_score::tables::table::{EpisodeTable, MetricColumn};
use mirrorstats_statistics::durations::competing::{Ending, Outcome};
use mirrorstats_statistics::durations::survival::Survival;
use mirrorstats_statistics::intervals::interval::Interval;

const MOST_COLUMNS: usize = 3;
const LEAST_PANEL: f64 = 120.0;
const PLOT_HEIGHT: f64 = 130.0;
/// The distance between markers along a curve, px.
const MARKER_EVERY: f64 = 38.0;

pub fn draw(scene: Scene<'_>, episodes: &EpisodeTable) -> Result<Drawn, FigureError> {
    let endings = endings(episodes, scene.metrics)?;
    let Scene { matrix, roster, width, .. } = scene;
    let grid = Grid { width, left: MARGIN + ROOM_LEFT, gap: ROOM_LEFT + 8.0, columns: MOST_COLUMNS };
    let titles = matrix.titles(&matrix.experiments);
    let (mut sheet, panels) = grid.at_least(LEAST_PANEL).panels(&matrix.experiments, &titles, PLOT_HEIGHT + ROOM_BELOW);
    let last = endings.values().flatten().map(|ending| ending.steps).max().unwrap_or(1).max(1);
    let mut has_band = false;
    for (experiment, body) in matrix.experiments.iter().zip(&panels.bodies) {
        let plot = Plot::new(Frame { height: PLOT_HEIGHT, ..*body }, 0.0..real(last) * 1.03, 0.0..1.04);
        let steps = whole_ticks(u32::try_from(last).unwrap_or(u32::MAX), 5);
        plot.axes(&mut sheet, (&steps, "step t"), (&rate_ticks(), "share decided"));
        let survival = |model| endings.get(&(*experiment, model)).and_then(|endings| Survival::of(endings));
        let curves: Vec<_> = roster.0.iter().filter_map(|it| Some((*it, survival(it.model)?))).collect();
        for (member, survival) in &curves {
            let is_dependent = matrix.reading(experiment, member.model, scene.metrics[0]).repeats();
            if let Some(bounds) = survival.bounds(CONFIDENCE).filter(|_| !is_dependent) {
                band(&mut sheet, &plot, survival, &bounds, *member);
                has_band = true;
            }
        }
        for (at, (member, survival)) in curves.iter().enumerate() {
            curve(&mut sheet, &plot, survival, experiment, *member, many(at) / many(curves.len()));
        }
    }
    let tick = Swatch::Tick(Stroke::solid(PALETTE.surface.quiet, 1.2));
    let mut signs = vec![(tick, "episodes that end undecided, censored".to_owned())];
    if has_band {
        signs.push((Swatch::Tile(Fill::faint(PALETTE.surface.text)), "95 % confidence band, by step".to_owned()));
    }
    let height = legend::around(&mut sheet, roster, &panels, Swatch::Line, signs);
    Ok((sheet, height))
}

/// The endings of the episodes of each experiment and model, by step.
///
/// The first metric is the duration; the second is defined if an episode is decided.
fn endings<'e>(
    episodes: &'e EpisodeTable,
    metrics: &[MetricId<'_>],
) -> Result<BTreeMap<(&'e str, &'e str), Vec<Ending>>, FigureError> {
    let (duration, finished) = (column(episodes, metrics[0].name)?, column(episodes, metrics[1].name)?);
    let mut endings: BTreeMap<(&str, &str), Vec<Ending>> = BTreeMap::new();
    for ((key, step), finished) in episodes.keys.iter().zip(duration.iter()).zip(finished.iter()) {
        let group = endings.entry((key.experiment, key.model)).or_default();
        let outcome = if finished.is_some() { Outcome::Correct } else { Outcome::Unfinished };
        group.extend(step.map(|steps| Ending { steps, outcome }));
    }
    Ok(endings)
}

fn column<'a>(episodes: &'a EpisodeTable, name: &str) -> Result<&'a MetricColumn, FigureError> {
    episodes.metric(name).ok_or_else(|| {
        let known = episodes.metrics.iter().map(|metric| metric.name.as_str()).collect::<Vec<_>>().join(", ");
        FigureError::UnknownMetric { figure: FigureName::DecisionCurve, metric: name.to_owned(), known }
    })
}

/// Fills the pointwise intervals of a curve, up to the step at which all are decided.
fn band(sheet: &mut Sheet, plot: &Plot, survival: &Survival, bounds: &[Interval], member: Member<'_>) {
    let mut last = Interval { low: 1.0, high: 1.0 };
    let (mut above, mut below) = (Vec::new(), Vec::new());
    for (point, bounds) in survival.points.iter().zip(bounds) {
        let next = if point.undecided > 0.0 { *bounds } else { last };
        for found in [last, next] {
            above.push(plot.at(real(point.steps), 1.0 - found.low));
            below.push(plot.at(real(point.steps), 1.0 - found.high));
        }
        last = next;
    }
    above.extend(below.into_iter().rev());
    sheet.polygon(&above, Fill::faint(member.style.color));
}

/// Draws a step curve. `phase` is the position of its first marker, in [0, 1) of a distance, so that the markers of
/// coinciding curves differ.
fn curve(sheet: &mut Sheet, plot: &Plot, survival: &Survival, experiment: &str, member: Member<'_>, phase: f64) {
    let points = &survival.points;
    let mut corners = vec![plot.at(0.0, 0.0)];
    let mut share = 0.0;
    for point in points {
        corners.push(plot.at(real(point.steps), share));
        share = 1.0 - point.undecided;
        corners.push(plot.at(real(point.steps), share));
    }
    sheet.mark(&mark(survival, experiment, member.model), |sheet| {
        sheet.line(&corners, member.style.stroke(1.3));
        for (at, point) in points.iter().enumerate() {
            let later = points.get(at + 1).map_or(0, |next| next.at_risk);
            if point.at_risk > point.decided + later {
                let (x, y) = plot.at(real(point.steps), 1.0 - point.undecided);
                sheet.line(&[(x, y - 3.0), (x, y + 3.0)], Stroke::solid(member.style.color, 1.2));
            }
        }
        // The wait before the first decision is the same for all curves, and too crowded for markers.
        let marked = if share > 0.0 { &corners[1..] } else { &corners[..] };
        for place in along(marked, phase) {
            marker::draw(sheet, place, 2.4, member.style);
        }
    });
}

fn mark(survival: &Survival, experiment: &str, model: &str) -> Mark {
    let points = &survival.points;
    let decided: u64 = points.iter().map(|point| point.decided).sum();
    let n = points.first().map_or(0, |point| point.at_risk);
    let median = survival.median();
    let median_words = median.map_or("none".to_owned(), |step| format!("t = {step}"));
    let title = format!("{experiment} · {model}: {decided} of {n} decided, median {median_words}");
    Mark::of_cell(title, experiment, model, "decided")
        .value(points.last().map(|point| 1.0 - point.undecided))
        .with("n", n)
        .with("decided", decided)
        .with("median", median.map(|step| step.to_string()).unwrap_or_default())
}

/// Evenly spaced points on a line; the first is `phase` of a distance from the start.
fn along(points: &[Point], phase: f64) -> Vec<Point> {
    let mut places = Vec::new();
    let mut due = MARKER_EVERY * (phase + 0.2);
    for pair in points.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let length = (to.0 - from.0).hypot(to.1 - from.1);
        while due <= length {
            let part = due / length;
            places.push((from.0 + (to.0 - from.0) * part, from.1 + (to.1 - from.1) * part));
            due += MARKER_EVERY;
        }
        due -= length;
    }
    places
}

#[expect(clippy::cast_precision_loss, reason = "steps are far below 2^53")]
fn real(step: i64) -> f64 {
    step as f64
}
