//! The check that a scene is solvable: the agent can walk to a place where it sees itself, and to every candidate.

use std::collections::VecDeque;

use super::super::config::WorldConfig;
use super::super::floor::FloorPlan;
use super::super::scene::{Cube, HungPane, MirrorPlace, Scene};
use mirrorstats_experiment::spec::Cubes;

/// The distance between points of the floor's lattice, m.
const LATTICE: f64 = 0.4;

/// The maximum distance from the mirror at which a body sees itself well, m.
const NEAR_ENOUGH: f64 = 3.0;

/// Tested heights of the body in the mirror, m above the floor, and tested places across it, m.
const HEIGHTS: [f64; 5] = [0.3, 0.6, 0.9, 1.15, 1.4];
const ACROSS: [f64; 3] = [-0.16, 0.0, 0.16];

/// The share of the body that must be visible for self-identification.
const ENOUGH: f64 = 0.75;

/// Returns true if the agent can walk to a place with a clear reflection, and to each candidate, within a third of the
/// episode each. Clutter, if any, must hide at least half of the body from the required share of places before the
/// mirror (paper, section 3: mirror evidence in E5 is partial or occluded).
pub(super) fn is_solvable(config: &WorldConfig, scene: &Scene, plan: &FloorPlan) -> bool {
    let near = within(config, scene, f64::from(config.episode.steps) / 3.0).map(|at| spot(scene, at));
    let near: Vec<[f64; 2]> = near.collect();
    let mirror = Glass { place: scene.mirror, width: config.mirror.width, bottom: 0.0, top: f64::INFINITY };
    let shares: Vec<f64> = near.iter().filter_map(|spot| share_shown(config, scene, mirror, *spot)).collect();
    let hidden = shares.iter().filter(|share| **share <= 0.5).count();
    let has_clutter = matches!(scene.experiment.layout.cubes, Cubes::Clutter { .. }) && !scene.cubes.is_empty();
    let reaches =
        |cube: &Cube| near.iter().any(|spot| cube.square().distance(*spot) <= plan.radius + config.body.step_length);
    shares.iter().any(|share| *share >= ENOUGH)
        && (!has_clutter || 100 * hidden >= config.clutter.hides_percent as usize * shares.len())
        && (!scene.experiment.has_candidates() || scene.cubes.iter().all(reaches))
}

/// The points of the lattice that the agent can walk to within this number of steps.
fn within(config: &WorldConfig, scene: &Scene, steps: f64) -> impl Iterator<Item = [i32; 2]> {
    let found = lengths(scene, &scene.floor_plan(config)).into_iter();
    let most = steps * config.body.step_length;
    found.filter(move |(_, length)| *length <= most).map(|(at, _)| at)
}

/// The places that the agent can walk to within the episode, every second one of the lattice in both directions.
pub(crate) fn reachable(config: &WorldConfig, scene: &Scene) -> Vec<[f64; 2]> {
    let found = within(config, scene, f64::from(config.episode.steps));
    found.filter(|at| at.iter().all(|at| at % 2 == 0)).map(|at| spot(scene, at)).collect()
}

/// What a place before a mirror depends on: lengths in m, heights above the floor.
#[derive(Clone, Copy)]
struct Glass {
    place: MirrorPlace,
    width: f64,
    bottom: f64,
    top: f64,
}

/// Returns true if an agent here that faces this pane squarely sees enough of its body, or of the part that a small pane
/// can show at all.
pub(super) fn is_clear(config: &WorldConfig, scene: &Scene, pane: &HungPane, spot: [f64; 2]) -> bool {
    let [bottom, top] = [-0.5, 0.5].map(|half| pane.center_height + half * pane.height);
    let glass = Glass { place: pane.place, width: pane.width, bottom, top };
    share_shown(config, scene, glass, spot).is_some_and(|share| share >= ENOUGH)
}

/// The share of the points of its body in the mirror that no cube hides from an agent here that faces it squarely;
/// `None` if the place is not before the mirror, or too far from it, or if the mirror is too high or too low.
fn share_shown(config: &WorldConfig, scene: &Scene, glass: Glass, spot: [f64; 2]) -> Option<f64> {
    let away = glass.place.distance(spot, config);
    let within = (glass.width / 2.0 - 0.3).max(0.1);
    let is_before = glass.place.aside(spot).abs() <= within && away <= NEAR_ENOUGH;
    // A point is seen in the plane of the mirror half-way between its height and that of the eye.
    let is_in = |height: &f64| (glass.bottom..=glass.top).contains(&f64::midpoint(*height, config.eye.height));
    let heights = HEIGHTS.into_iter().filter(is_in);
    let points: Vec<_> = heights.flat_map(|height| ACROSS.map(|across| [across, height])).collect();
    let is_hidden = |point| scene.cubes.iter().any(|cube| is_hidden(config, glass.place, cube, spot, point));
    let shown = points.iter().filter(|point| !is_hidden(**point)).count();
    #[expect(clippy::cast_precision_loss, reason = "a few points")]
    (is_before && !points.is_empty()).then(|| shown as f64 / points.len() as f64)
}

/// Returns true if a cube hides the point of the body at this place across it and this height from an agent who looks
/// into the mirror. It may be on the way to the mirror or back.
fn is_hidden(
    config: &WorldConfig,
    mirror: MirrorPlace,
    cube: &Cube,
    spot: [f64; 2],
    [across, height]: [f64; 2],
) -> bool {
    let (away, depth) = (mirror.distance(spot, config), mirror.distance([cube.x, cube.y], config));
    let aside = mirror.aside([cube.x, cube.y]) - mirror.aside(spot);
    let eye = config.eye.height;
    depth < away
        && [away - depth, away + depth].into_iter().any(|way| {
            let part = way / (2.0 * away);
            let passes = [part * across, eye + part * (height - eye)];
            (passes[0] - aside).abs() <= cube.edge / 2.0 && (cube.base..=cube.top()).contains(&passes[1])
        })
}

/// A point of the lattice in the room.
fn spot(scene: &Scene, at: [i32; 2]) -> [f64; 2] {
    [scene.start.x + LATTICE * f64::from(at[0]), scene.start.y + LATTICE * f64::from(at[1])]
}

/// The points of the lattice that the agent can walk to, with the lengths of the ways.
fn lengths(scene: &Scene, plan: &FloorPlan) -> Vec<([i32; 2], f64)> {
    let mut found = vec![([0_i32, 0_i32], 0.0)];
    let mut queue = VecDeque::from([0]);
    let mut seen = std::collections::BTreeSet::from([[0, 0]]);
    while let Some(at) = queue.pop_front() {
        let (from, length) = found[at];
        for to in [[1, 0], [-1, 0], [0, 1], [0, -1]].map(|[right, up]| [from[0] + right, from[1] + up]) {
            if !seen.contains(&to) && plan.is_passable(spot(scene, from), spot(scene, to)) {
                seen.insert(to);
                queue.push_back(found.len());
                found.push((to, length + LATTICE));
            }
        }
    }
    found
}
