//! The label of every pixel by MuJoCo's own rays, fifty times slower than the casts of the world.

use mirrorstats_experiment::spec::PaneKind;
use mirrorstats_sim::label_image::LabelImage;
use mirrorstats_sim::mirror_eye;
use mirrorstats_sim::model::{Item, Stage};
use mirrorstats_sim::visibility::{RayView, Shown};
use mirrorstats_sim::world::World;

type Vector = [f64; 3];

/// All groups of geoms but the hidden one.
const SHOWN_GROUPS: [u8; 6] = [1, 1, 1, 1, 0, 0];

pub(super) fn labels_by_mujoco(world: &World, width: usize, height: usize) -> LabelImage {
    let mut stages = Stage::all(world.config(), world.scene()).unwrap();
    world.show_on(&mut stages);
    let (stage, beyond) = stages.split_first_mut().unwrap();
    let view = RayView::of_eye(world, width, height);
    let mut codes = Vec::with_capacity(width * height);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let ray = view.ray(x, y);
        let (geom, distance) = stage.data.ray(&view.origin, &ray, Some(&SHOWN_GROUPS), true, None, None);
        let shown = match geom.map_or(Item::Room, |geom| stage.items[geom]) {
            Item::Pane(pane) => {
                let met = along(view.origin, distance, ray);
                Shown::Through(pane, onwards(world, &mut beyond[pane], pane, met, ray))
            }
            item => Shown::Direct(item),
        };
        codes.push(shown.code());
    }
    LabelImage { width, height, codes }
}

/// What a ray meets after a pane: reflected, or in the second room.
fn onwards(world: &World, stage: &mut Stage, pane: usize, met: Vector, ray: Vector) -> Item {
    let hung = &world.scene().panes[pane];
    let [out_x, out_y] = hung.place.heading().direction();
    let out = [out_x, out_y, 0.0];
    let (from, ray) = match hung.kind {
        PaneKind::Window => (along(met, -mirror_eye::shift(world.config()), out), ray),
        _ => (met, along(ray, -2.0 * (ray[0] * out_x + ray[1] * out_y), out)),
    };
    let (geom, _) = stage.data.ray(&along(from, 1e-9, ray), &ray, Some(&SHOWN_GROUPS), true, None, None);
    geom.map_or(Item::Room, |geom| stage.items[geom])
}

fn along(from: Vector, length: f64, direction: Vector) -> Vector {
    [0, 1, 2].map(|axis| from[axis] + length * direction[axis])
}
