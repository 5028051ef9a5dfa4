//! A scene's changes to the model: the places of panes, its cubes, bodies and marks, and all colours.

use mujoco_rs::prelude::{MjModel, MjtObjBase};

use super::super::body::BodyModel;
use super::super::config::WorldConfig;
use super::super::scene::{Cube, HandShape, HandStart, HungPane, Scene, WornMark};
use super::{AGENTS, BARS, Item, group, numbered, shadow};
use crate::scene::MOST_CUBES;
use mirrorstats_experiment::angle::{Heading, Quaternion};
use mirrorstats_experiment::spec::{MOST_MARKS, PaneKind};
use mirrorstats_trace::schema::colors::Color;

/// Half the depth of a pane, m.
const HALF_DEPTH: f64 = 0.000_05;

/// The paint of a pane, which its image covers; it shows at most at the edges of things before it.
const BLANK: [u8; 3] = [128, 132, 138];

/// Walls by their quarter turns from +x.
const WALLS: [&str; 4] = ["wall_east", "wall_north", "wall_west", "wall_south"];

/// `through` is the pane of the view; `None` for the direct one.
pub(super) fn dress(model: &mut MjModel, items: &[Item], config: &WorldConfig, scene: &Scene, through: Option<usize>) {
    let pane = through.map(|at| (at, &scene.panes[at]));
    let is_window = pane.is_some_and(|(_, pane)| pane.kind == PaneKind::Window);
    let neutral = BodyModel::new(config.body.shape).neutral_parts;
    for (geom, item) in items.iter().enumerate() {
        match *item {
            Item::Room => {
                hide_wall(model, geom, pane.map(|(_, pane)| pane));
                frame(model, geom, scene, config, pane.is_none());
                let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default().to_owned();
                shadow::dress(model, geom, &name, scene, pane);
            }
            Item::Pane(at) => hang(model, geom, scene.panes.get(at).filter(|_| pane.is_none()), config),
            Item::Cube(at) => put_cube(model, geom, scene.cubes.get(at).filter(|_| !is_window)),
            Item::Agent(agent) => {
                let color = scene.agent_color(agent, pane.map(|(_, pane)| pane));
                paint_body(model, geom, color, if agent == 0 { group::EGO } else { group::THINGS }, neutral);
            }
            Item::Double => {
                let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
                let own = pane.filter(|(at, _)| numbered(name, "double") == Some(*at));
                let color = own.and_then(|(_, pane)| pane.double).map(|double| double.color);
                paint_body(model, geom, color, group::THINGS, neutral);
            }
            Item::Mark(at) => {
                hide(model, geom);
                if let Some(mark) = scene.marks.get(at) {
                    put_patch(model, geom, scene, mark);
                }
            }
            Item::Hand => put_hand(model, geom, scene.hand.as_ref().filter(|_| !is_window)),
        }
    }
}

/// Shows the marks and the panes of a step, counted from 1.
pub(super) fn show_at(model: &mut MjModel, items: &[Item], scene: &Scene, t: u32, through: Option<usize>) {
    let pane = through.map(|at| &scene.panes[at]);
    if pane.is_none() {
        show_panes(model, items, scene, t);
    }
    for (geom, item) in items.iter().enumerate() {
        let Item::Mark(at) = *item else { continue };
        let Some(mark) = scene.marks.get(at) else { continue };
        let is_there = mark.from_t <= t && scene.agent_color(mark.wearer, pane).is_some();
        model.geom_group_mut()[geom] = match (is_there, mark.wearer) {
            (false, _) => group::HIDDEN,
            (true, 0) => group::EGO,
            (true, _) => group::THINGS,
        };
        model.geom_rgba_mut()[geom] = paint(mark.color.rgb());
    }
}

fn show_panes(model: &mut MjModel, items: &[Item], scene: &Scene, t: u32) {
    for (geom, item) in items.iter().enumerate() {
        let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
        let shown = match *item {
            Item::Pane(at) => scene.panes.get(at),
            _ => numbered(name, FRAME).and_then(|bar| scene.panes.get(bar / BARS)).filter(|pane| pane.frame),
        };
        if let Some(pane) = shown {
            model.geom_group_mut()[geom] = if pane.is_shown_at(t) { group::ROOM } else { group::HIDDEN };
        }
    }
}

impl Item {
    /// The number of items apart from panes: the room, then bodies, cubes, marks, the hand, the double.
    pub(crate) const COUNT: usize = 1 + AGENTS + MOST_CUBES + MOST_MARKS + 2;

    /// Its number below [`Item::COUNT`]; a pane has that of the room.
    pub(crate) const fn number(self) -> usize {
        match self {
            Self::Room | Self::Pane(_) => 0,
            Self::Agent(agent) => 1 + agent,
            Self::Cube(cube) => 1 + AGENTS + cube,
            Self::Mark(mark) => 1 + AGENTS + MOST_CUBES + mark,
            Self::Hand => Self::COUNT - 2,
            Self::Double => Self::COUNT - 1,
        }
    }

    pub(crate) const fn from_number(number: usize) -> Self {
        match number {
            0 => Self::Room,
            _ if number < 1 + AGENTS => Self::Agent(number - 1),
            _ if number < 1 + AGENTS + MOST_CUBES => Self::Cube(number - 1 - AGENTS),
            _ if number < Self::COUNT - 2 => Self::Mark(number - 1 - AGENTS - MOST_CUBES),
            _ if number == Self::COUNT - 2 => Self::Hand,
            _ => Self::Double,
        }
    }
}

fn hide_wall(model: &mut MjModel, geom: usize, pane: Option<&HungPane>) {
    let Some(pane) = pane else { return };
    // The second room is the first one moved by its size: the view enters through the wall across.
    let across = if pane.kind == PaneKind::Window { 2 } else { 0 };
    let wall = WALLS[usize::from((pane.place.wall + across) % 4)];
    if model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom) == Some(wall) {
        hide(model, geom);
    }
}

fn hide(model: &mut MjModel, geom: usize) {
    model.geom_group_mut()[geom] = group::HIDDEN;
}

fn hang(model: &mut MjModel, geom: usize, pane: Option<&HungPane>, config: &WorldConfig) {
    let Some(pane) = pane else { return hide(model, geom) };
    let [x, y] = pane.place.center(config);
    let [out_x, out_y] = pane.place.heading().direction();
    let half = [pane.height / 2.0, pane.width / 2.0, HALF_DEPTH];
    // A pane is placed by its face, not by its middle.
    model.geom_pos_mut()[geom] = [x + HALF_DEPTH * out_x, y + HALF_DEPTH * out_y, pane.center_height];
    model.geom_quat_mut()[geom] = facing_inwards(pane.place.heading()).0;
    model.geom_group_mut()[geom] = group::ROOM;
    model.geom_size_mut()[geom] = half;
    model.geom_rbound_mut()[geom] = half.iter().sum();
    model.geom_rgba_mut()[geom] = paint(BLANK);
}

/// Half of the width of a frame's bars, m.
pub(crate) const HALF_BAR: f64 = 0.03;

/// The prefix of the names of a frame's bars.
pub(super) const FRAME: &str = "frame";

/// Puts a frame's bar beside its pane, flush with it, so that it hides nothing; only direct views show frames.
fn frame(model: &mut MjModel, geom: usize, scene: &Scene, config: &WorldConfig, is_direct: bool) {
    let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
    let Some(number) = numbered(name, FRAME) else { return };
    let pane = scene.panes.get(number / BARS).filter(|pane| pane.frame && is_direct);
    let Some(pane) = pane else { return hide(model, geom) };
    let [x, y] = pane.place.center(config);
    let [out_x, out_y] = pane.place.heading().direction();
    let (up, side) = (pane.height / 2.0 + HALF_BAR, pane.width / 2.0 + HALF_BAR);
    // Relative to the middle of the pane: upwards, and to the left of a viewer who faces it.
    let (rise, aside, half) = match number % BARS {
        0 => (up, 0.0, [HALF_BAR, side + HALF_BAR]),
        1 => (-up, 0.0, [HALF_BAR, side + HALF_BAR]),
        2 => (0.0, side, [pane.height / 2.0, HALF_BAR]),
        _ => (0.0, -side, [pane.height / 2.0, HALF_BAR]),
    };
    let depth = config.mirror.gap / 2.0;
    let place = [x + depth * out_x - aside * out_y, y + depth * out_y + aside * out_x, pane.center_height + rise];
    model.geom_pos_mut()[geom] = place;
    model.geom_quat_mut()[geom] = facing_inwards(pane.place.heading()).0;
    model.geom_group_mut()[geom] = group::ROOM;
    model.geom_size_mut()[geom] = [half[0], half[1], depth];
    model.geom_rbound_mut()[geom] = half[0] + half[1] + depth;
    model.geom_rgba_mut()[geom] = paint(WOOD);
}

const WOOD: [u8; 3] = [88, 66, 48];

fn facing_inwards(heading: Heading) -> Quaternion {
    let quarter = std::f64::consts::FRAC_1_SQRT_2;
    heading.rotation().after(Quaternion([quarter, 0.0, -quarter, 0.0]))
}

fn put_cube(model: &mut MjModel, geom: usize, cube: Option<&Cube>) {
    let Some(cube) = cube else { return hide(model, geom) };
    let half = cube.edge / 2.0;
    model.geom_group_mut()[geom] = group::THINGS;
    model.geom_pos_mut()[geom] = [cube.x, cube.y, cube.base + half];
    model.geom_quat_mut()[geom] = [1.0, 0.0, 0.0, 0.0];
    model.geom_size_mut()[geom] = [half; 3];
    // The radius of the sphere around it, by which a renderer culls invisible things.
    model.geom_rbound_mut()[geom] = half * 2.0;
    model.geom_rgba_mut()[geom] = paint(cube.color.rgb());
}

/// Half of the depth of a patch, m.
const HALF_PATCH: f64 = 0.004;

fn put_patch(model: &mut MjModel, geom: usize, scene: &Scene, mark: &WornMark) {
    let Some(patch) = mark.patch else { return };
    let half = f64::from(patch.edge_mm) / 2000.0;
    model.geom_pos_mut()[geom] = patch.center(scene.start);
    model.geom_quat_mut()[geom] = scene.start.heading.rotation().0;
    model.geom_size_mut()[geom] = [HALF_PATCH, half, half];
    model.geom_rbound_mut()[geom] = half * 2.0;
}

fn put_hand(model: &mut MjModel, geom: usize, hand: Option<&HandStart>) {
    let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
    let Some(hand) = hand.filter(|hand| name.ends_with(hand.shape.name())) else { return hide(model, geom) };
    let half = hand.half();
    model.geom_group_mut()[geom] = group::THINGS;
    model.geom_size_mut()[geom] = match hand.shape {
        HandShape::Ball => [half, 0.0, 0.0],
        HandShape::Block => [half; 3],
    };
    model.geom_rbound_mut()[geom] = half * 2.0;
    model.geom_rgba_mut()[geom] = paint(hand.color.rgb());
}

fn paint_body(model: &mut MjModel, geom: usize, color: Option<Color>, shown: i32, neutral: &[&str]) {
    let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
    let part = name.split_once('_').map_or("", |(_, part)| part);
    let (is_neutral, is_mark) = (neutral.contains(&part), part.starts_with("mark_"));
    model.geom_group_mut()[geom] = if color.is_some() && !is_mark { shown } else { group::HIDDEN };
    if let (Some(color), false) = (color, is_neutral) {
        model.geom_rgba_mut()[geom] = paint(color.rgb());
    }
}

fn paint(rgb: [u8; 3]) -> [f32; 4] {
    let [red, green, blue] = rgb.map(|part| f32::from(part) / 255.0);
    [red, green, blue, 1.0]
}
