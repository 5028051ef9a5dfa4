//! What a scene changes in the model: where the mirror hangs, which cubes and bodies there are, and all colours.

use mujoco_rs::prelude::MjModel;
use mujoco_rs::prelude::MjtObjBase;

use super::super::angle::{Heading, Quaternion};
use super::super::config::WorldConfig;
use super::super::scene::{Cube, Scene};
use super::{AGENTS, Item, group};

/// Parts of the humanoid that keep their own colour.
const NEUTRAL_PARTS: [&str; 2] = ["head", "neck"];

/// Puts a scene's mirror, cubes and colours in, and hides what it has not.
pub(super) fn dress(model: &mut MjModel, items: &[Item], config: &WorldConfig, scene: &Scene) {
    for (geom, item) in items.iter().enumerate() {
        match *item {
            Item::Room => {}
            Item::Mirror => hang_mirror(model, geom, config, scene),
            Item::Cube(at) => put_cube(model, geom, scene.cubes.get(at)),
            Item::Agent(agent) => paint_agent(model, geom, agent, scene),
        }
    }
}

/// Gives every part the colour that names what it is of.
pub(super) fn label(model: &mut MjModel, items: &[Item]) {
    for (geom, item) in items.iter().enumerate() {
        let red = u8::try_from(STEP * number(*item)).expect("a world holds fewer than 30 things");
        if *item != Item::Mirror {
            model.geom_rgba_mut()[geom] = paint([red, 0, 0]);
        }
    }
}

/// Between the reds of two labels.
const STEP: usize = 8;

fn number(item: Item) -> usize {
    match item {
        Item::Room | Item::Mirror => 0,
        Item::Agent(agent) => 1 + agent,
        Item::Cube(cube) => 1 + AGENTS + cube,
    }
}

/// The item whose label has this red; `None` where none has.
pub fn labelled(red: u8) -> Option<Item> {
    let red = usize::from(red);
    let number = (red % STEP == 0).then_some(red / STEP)?;
    Some(match number {
        0 => Item::Room,
        _ if number <= AGENTS => Item::Agent(number - 1),
        _ => Item::Cube(number - 1 - AGENTS),
    })
}

fn hang_mirror(model: &mut MjModel, geom: usize, config: &WorldConfig, scene: &Scene) {
    let [x, y] = scene.mirror.center(config);
    model.geom_pos_mut()[geom] = [x, y, config.mirror.center_height];
    model.geom_quat_mut()[geom] = facing_inwards(scene.mirror.heading()).0;
    model.geom_group_mut()[geom] = if scene.has_mirror() { group::ROOM } else { group::HIDDEN };
}

/// The rotation of a plane on the wall of that heading: its front into the room, its x axis up.
fn facing_inwards(heading: Heading) -> Quaternion {
    let quarter = std::f64::consts::FRAC_1_SQRT_2;
    heading.rotation().after(Quaternion([quarter, 0.0, -quarter, 0.0]))
}

fn put_cube(model: &mut MjModel, geom: usize, cube: Option<&Cube>) {
    let Some(cube) = cube else {
        model.geom_group_mut()[geom] = group::HIDDEN;
        return;
    };
    let half = cube.edge / 2.0;
    model.geom_group_mut()[geom] = group::THINGS;
    model.geom_pos_mut()[geom] = [cube.x, cube.y, cube.base + half];
    model.geom_size_mut()[geom] = [half; 3];
    // Of the sphere about it, by which a renderer leaves out what is not in view.
    model.geom_rbound_mut()[geom] = half * 2.0;
    model.geom_rgba_mut()[geom] = paint(cube.color.rgb());
}

fn paint_agent(model: &mut MjModel, geom: usize, agent: usize, scene: &Scene) {
    let color = match agent.checked_sub(1) {
        None => Some(scene.body_color),
        Some(other) => scene.others.get(other).map(|other| other.color),
    };
    model.geom_group_mut()[geom] = match (agent, color) {
        (0, _) => group::EGO,
        (_, Some(_)) => group::THINGS,
        (_, None) => group::HIDDEN,
    };
    if let (Some(color), false) = (color, is_neutral(model, geom)) {
        model.geom_rgba_mut()[geom] = paint(color.rgb());
    }
}

fn is_neutral(model: &MjModel, geom: usize) -> bool {
    let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
    name.split_once('_').is_some_and(|(_, part)| NEUTRAL_PARTS.contains(&part))
}

fn paint(rgb: [u8; 3]) -> [f32; 4] {
    let [red, green, blue] = rgb.map(|part| f32::from(part) / 255.0);
    [red, green, blue, 1.0]
}
