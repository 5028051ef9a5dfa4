//! `scatter`: one rate against another, one point per model and experiment, its size a relative duration.

use crate::kit::{
    Frame, Grid, MARGIN, Mark, PALETTE, Plot, ROOM_BELOW, ROOM_LEFT, Sheet, Stroke, Swatch, dodge, legend, marker,
    rate_ticks,
};
use crate::matrix::MetricId;
use crate::missing::{self, Strip};
use crate::{Drawn, Scene};

const MOST_COLUMNS: usize = 3;
const LEAST_PANEL: f64 = 120.0;
/// The radius of the marker with the greatest duration, px; the area is proportional to relative duration.
const LARGEST: f64 = 5.6;
/// The smallest radius of a visible shape, px.
const SMALLEST: f64 = 2.0;

pub fn draw(scene: Scene<'_>) -> Drawn {
    let Scene { matrix, roster, metrics, width: all } = scene;
    let ids = [metrics[0], metrics[1], metrics[2]];
    let grid = Grid { width: all, left: MARGIN + ROOM_LEFT, gap: ROOM_LEFT + 8.0, columns: MOST_COLUMNS };
    let grid = grid.at_least(LEAST_PANEL);
    let width = grid.panel();
    let (strips, below) = Strip::of_experiments(scene, &ids[..2], width);
    let titles = matrix.titles(&matrix.experiments);
    let (mut sheet, panels) = grid.panels(&matrix.experiments, &titles, width + (ROOM_BELOW + below));
    for ((experiment, body), strip) in matrix.experiments.iter().zip(&panels.bodies).zip(&strips) {
        let plot = Plot::new(Frame { height: width, ..*body }, -0.06..1.06, -0.06..1.06);
        plot.axes(&mut sheet, (&rate_ticks(), ids[0].name), (&rate_ticks(), ids[1].name));
        sheet.line(&[plot.at(0.0, 0.0), plot.at(1.0, 1.0)], diagonal());
        points(&mut sheet, scene, experiment, ids, &plot);
        strip.draw(&mut sheet, (body.left, body.top + width + ROOM_BELOW));
    }
    let signs = signs(ids).into_iter().chain(missing::strip_signs(&strips)).collect();
    let height = legend::around(&mut sheet, roster, &panels, Swatch::Marker, signs);
    (sheet, height)
}

fn diagonal() -> Stroke {
    Stroke { color: PALETTE.surface.axis, width: 1.0, dash: &[4.0, 3.0] }
}

fn points(sheet: &mut Sheet, scene: Scene<'_>, experiment: &str, ids: [MetricId<'_>; 3], plot: &Plot) {
    let greatest = scene.matrix.span(experiment, ids[2]).map(|(_, greatest)| greatest);
    let seen = scene.roster.0.iter().filter_map(|member| {
        let readings @ [x, y, duration] = ids.map(|id| scene.matrix.reading(experiment, member.model, id));
        Some((*member, readings, (x.mean()?, y.mean()?), radius(duration.mean(), greatest)))
    });
    let mut seen: Vec<_> = seen.collect();
    // The large first, so that they do not hide the small.
    seen.sort_by(|a, b| b.3.total_cmp(&a.3));
    let places: Vec<_> = seen.iter().map(|&(_, _, (x, y), _)| plot.at(x, y)).collect();
    for ((member, readings, (x, y), radius), place) in seen.into_iter().zip(dodge::fanned(&places, 7.0)) {
        let parts = [1, 0, 2].map(|at| format!("{}: {}", ids[at].name, readings[at].words()));
        let title = format!("{experiment} · {} · {}", member.model, parts.join(" · "));
        let mark = Mark::of_cell(title, experiment, member.model, ids[1].name)
            .value(Some(y))
            .with("n", readings[1].n())
            .number(ids[0].attribute(), Some(x))
            .number(ids[2].attribute(), readings[2].mean());
        sheet.mark(&mark, |sheet| marker::draw(sheet, place, radius, member.style));
    }
}

/// The radius for an area proportional to the duration relative to the greatest; the smallest size without a duration.
fn radius(duration: Option<f64>, greatest: Option<f64>) -> f64 {
    match (duration, greatest) {
        (Some(duration), Some(greatest)) if greatest > 0.0 => {
            SMALLEST.max(LARGEST * (duration / greatest).max(0.0).sqrt())
        }
        _ => SMALLEST,
    }
}

fn signs([x, y, duration]: [MetricId<'_>; 3]) -> Vec<(Swatch, String)> {
    let ring = |share: f64| Swatch::Ring(radius(Some(share), Some(1.0)));
    vec![
        (ring(1.0), format!("the greatest {}", duration.name)),
        (ring(0.5), "half of it".to_owned()),
        (ring(0.2), "a fifth of it".to_owned()),
        (Swatch::Rule(diagonal()), format!("{} = {}", y.name, x.name)),
        (Swatch::None, "points with the same values are fanned out".to_owned()),
    ]
}
