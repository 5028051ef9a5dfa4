//! Whether a scene can be solved: whether the agent can walk to a place where it sees itself, and to every candidate.

use std::collections::VecDeque;

use super::super::config::WorldConfig;
use super::super::floor::FloorPlan;
use super::super::scene::{Cube, Scene};

/// Between two points of the lattice that stands for the floor, m.
const LATTICE: f64 = 0.4;

/// A body sees itself well from no further than this from the mirror, m.
const NEAR_ENOUGH: f64 = 3.0;

/// A cube lower than this leaves the upper body in the mirror, m.
const LOW_ENOUGH: f64 = 0.9;

/// Whether the agent can walk to a place before the mirror with its reflection clear, and to each candidate, within a
/// third of the episode each.
pub(super) fn is_solvable(config: &WorldConfig, scene: &Scene, plan: &FloorPlan) -> bool {
    let steps = lengths(scene, plan);
    let budget = f64::from(config.episode.steps) / 3.0 * config.body.step_length;
    let near: Vec<[f64; 2]> = steps.iter().filter(|(_, length)| *length <= budget).map(|(spot, _)| *spot).collect();
    let sees_itself = near.iter().any(|spot| shows_itself(config, scene, *spot));
    let reaches =
        |cube: &Cube| near.iter().any(|spot| cube.square().distance(*spot) <= plan.radius + config.body.step_length);
    sees_itself && (!scene.experiment.has_candidates() || scene.cubes.iter().all(reaches))
}

/// Whether one who stands there and faces the mirror squarely has the upper body in it.
fn shows_itself(config: &WorldConfig, scene: &Scene, spot: [f64; 2]) -> bool {
    let mirror = scene.mirror;
    let away = mirror.distance(spot, config);
    let is_before = mirror.aside(spot).abs() <= config.mirror.width / 2.0 - 0.3 && away <= NEAR_ENOUGH;
    is_before
        && scene.cubes.iter().filter(|cube| cube.top() > LOW_ENOUGH).all(|cube| {
            let beside = (mirror.aside([cube.x, cube.y]) - mirror.aside(spot)).abs() >= cube.edge / 2.0 + 0.3;
            beside || mirror.distance([cube.x, cube.y], config) > away
        })
}

/// Every point of the lattice that the agent can come to, and the length of a way there, m.
fn lengths(scene: &Scene, plan: &FloorPlan) -> Vec<([f64; 2], f64)> {
    let mut found = vec![([0_i32, 0_i32], 0.0)];
    let mut queue = VecDeque::from([0]);
    let spot = |at: [i32; 2]| [scene.start.x + LATTICE * f64::from(at[0]), scene.start.y + LATTICE * f64::from(at[1])];
    let mut seen = std::collections::BTreeSet::from([[0, 0]]);
    while let Some(at) = queue.pop_front() {
        let (from, length) = found[at];
        for to in [[1, 0], [-1, 0], [0, 1], [0, -1]].map(|[right, up]| [from[0] + right, from[1] + up]) {
            if !seen.contains(&to) && plan.is_passable(spot(from), spot(to)) {
                seen.insert(to);
                queue.push_back(found.len());
                found.push((to, length + LATTICE));
            }
        }
    }
    found.into_iter().map(|(at, length)| (spot(at), length)).collect()
}
