//! Soft shadows of the textured look: thin layers on the floor under bodies and cubes, fainter with width.
//!
//! Rule: a shadow is part of the room: labels, counts and logs do not contain it.

use mujoco_rs::prelude::{MjEditError, MjModel, MjSpec, MjtGeomBase, SpecItem};

use super::{AGENTS, BODIES, body_name, group, numbered};
use crate::scene::{HungPane, MOST_CUBES, Scene};
use mirrorstats_experiment::spec::PaneKind;

/// The infix of all layers' names, after the owner's name.
pub(super) const NAMED: &str = "_shadow";

/// The width of each layer beyond its owner, m.
const RIMS: [f64; 4] = [0.0, 0.06, 0.12, 0.18];

/// The radius of the innermost layer under a body, m.
const UNDER_BODY: f64 = 0.14;

/// The distance between layers, m: enough for depth precision at the other end of a room.
const RISE: f64 = 0.002;

/// The share of light that each layer absorbs.
const SHADE: f32 = 0.13;

/// Adds the layers to a model; a body's layers move with it.
pub(super) fn build(spec: &mut MjSpec) -> Result<(), MjEditError> {
    for body in (0..BODIES).map(body_name) {
        layers(|at, rim| {
            let geom = spec.body_mut(&format!("{body}_trunk")).expect("every body has a trunk").add_geom();
            geom.set_type(MjtGeomBase::mjGEOM_CYLINDER);
            *geom.size_mut() = [UNDER_BODY + rim, RISE / 8.0, 0.0];
            *geom.pos_mut() = [0.0, 0.0, height(at)];
            *geom.rgba_mut() = [0.0, 0.0, 0.0, SHADE];
            geom.set_contype(0);
            geom.set_conaffinity(0);
            geom.set_name(&format!("{body}{NAMED}{at}"))
        })?;
    }
    (0..MOST_CUBES).try_for_each(|cube| {
        layers(|at, _| {
            let geom = spec.world_body_mut().add_geom();
            geom.set_type(MjtGeomBase::mjGEOM_BOX);
            *geom.size_mut() = [1.0, 1.0, RISE / 8.0];
            // MuJoCo never moves things that are at the origin when it compiles.
            *geom.pos_mut() = [0.0, 0.0, -50.0];
            *geom.rgba_mut() = [0.0, 0.0, 0.0, SHADE];
            geom.set_contype(0);
            geom.set_conaffinity(0);
            geom.set_name(&format!("cube{cube}{NAMED}{at}"))
        })
    })
}

fn layers(mut each: impl FnMut(usize, f64) -> Result<(), MjEditError>) -> Result<(), MjEditError> {
    RIMS.into_iter().enumerate().try_for_each(|(at, rim)| each(at, rim))
}

/// The widest layer is the lowest, so that the others are drawn over it.
fn height(at: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "a few layers")]
    let above = (RIMS.len() - at) as f64;
    RISE * above
}

/// Puts a cube's layer under it; shows layers in the views that show their owners.
pub(super) fn dress(model: &mut MjModel, geom: usize, name: &str, scene: &Scene, pane: Option<(usize, &HungPane)>) {
    let Some((owner, layer)) = name.split_once(NAMED) else { return };
    let layer: usize = layer.parse().unwrap_or(0);
    let is_window = pane.is_some_and(|(_, pane)| pane.kind == PaneKind::Window);
    let is_shown = if let Some(agent) = numbered(owner, "agent") {
        agent < AGENTS && scene.agent_color(agent, pane.map(|(_, pane)| pane)).is_some()
    } else if let Some(double) = numbered(owner, "double") {
        pane.is_some_and(|(at, pane)| at == double && pane.double.is_some())
    } else {
        let cube =
            numbered(owner, "cube").and_then(|at| scene.cubes.get(at)).filter(|cube| cube.base <= 0.0 && !is_window);
        if let Some(cube) = cube {
            let half = cube.edge / 2.0 + RIMS[layer.min(RIMS.len() - 1)];
            model.geom_pos_mut()[geom] = [cube.x, cube.y, height(layer)];
            model.geom_size_mut()[geom] = [half, half, RISE / 8.0];
            model.geom_rbound_mut()[geom] = 2.0 * half;
        }
        cube.is_some()
    };
    model.geom_group_mut()[geom] = if is_shown { group::ROOM } else { group::HIDDEN };
}
