//! The world in MuJoCo: one model for all experiments, adapted to a scene and posed for a moment.
//!
//! Every world has seven humanoids, twelve cubes, and for each of four panes a place and a humanoid that only it shows.
//! Those that a scene lacks are in a hidden group, which pictures and rays exclude. So all models have one layout, and
//! a renderer switches worlds at no cost.
//!
//! A scene has several stages: the room as seen directly, with blank panes, and the view through each pane. The latter
//! is the room without the pane's wall, with bodies where and how the pane shows them. MuJoCo draws at most one mirror;
//! a stage per pane permits any number, including late and false ones.
//! Rule: the sizes of planes never change after compiling, because a renderer caches them; panes are boxes.

mod dress;
mod shadow;

pub(crate) use dress::HALF_BAR;

use std::sync::Arc;

use mujoco_rs::prelude::{Attach, MjData, MjEditError, MjModel, MjSpec, MjtGeomBase, MjtObjBase, SpecItem};

use super::body::{BodyModel, Figure, Piece, Pose};
use super::config::{EyeConfig, LightsConfig, WorldConfig};
use super::scene::{MOST_CUBES, MOST_OTHERS, Scene};
use mirrorstats_experiment::angle::{Heading, Quaternion, sine_cosine};
use mirrorstats_experiment::spec::{MOST_MARKS, MOST_PANES, Part};

/// Humanoids in a room: the agent's own body, then the others.
pub const AGENTS: usize = 1 + MOST_OTHERS;

/// Humanoids in every model: those of the room, then one for each pane, which only that pane shows.
pub(crate) const BODIES: usize = AGENTS + MOST_PANES;

pub const EYE_CAMERA: &str = "eye";

/// The camera for a pane: the eye's mirror image, or the eye in the second room.
pub(crate) const BEYOND_CAMERA: &str = "beyond";

/// The hand's body, and the prefix of its shapes' names.
pub const HAND: &str = "hand";

pub(crate) const PATCH: &str = "patch";

pub(crate) const TOP_CAMERA: &str = "top";

/// Groups for MuJoCo's pictures and rays.
pub mod group {
    /// Walls, floor and panes.
    pub const ROOM: i32 = 0;
    /// Cubes and other agents.
    pub(crate) const THINGS: i32 = 1;
    pub(crate) const EGO: i32 = 2;
    /// The ceiling, which the view from above excludes.
    pub const CEILING: i32 = 3;
    /// The geom group of things that a scene lacks; MuJoCo does not draw it by default.
    pub const HIDDEN: i32 = 5;
}

const ROOM: &str = include_str!("../../../assets/world/room.xml");
/// The panels of textured walls, instead of the matte material.
const PANELS: &str = r#"<texture name="panels" type="2d" builtin="flat" mark="edge" rgb1="1 1 1" markrgb="0.72 0.72 0.74" width="64" height="64"/>
    <material name="panels" texture="panels" texuniform="true" texrepeat="0.9 0.9" specular="0" shininess="0" reflectance="0"/>
  </asset>"#;

/// Bars of a frame: top, bottom and both sides.
pub(super) const BARS: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Item {
    /// The surface of a mirror or window of the scene.
    Pane(usize),
    /// Walls, floor or ceiling.
    Room,
    /// A humanoid of the room: 0 is the agent's own body.
    Agent(usize),
    /// The humanoid that only one pane shows.
    Double,
    Cube(usize),
    Mark(usize),
    Hand,
}

#[derive(Clone, Copy, Debug)]
pub struct SceneMoment {
    /// The next step, from 1, which determines the visible marks and panes.
    pub t: u32,
    /// The humanoids by number; `None` for absent ones.
    pub bodies: [Option<Figure>; BODIES],
    /// The pose of the camera behind a pane.
    pub beyond: Option<Pose>,
    pub hand: Option<[f64; 3]>,
}

#[derive(Debug, thiserror::Error)]
#[error("mujoco cannot build the world: {0}; the configuration or the library is at fault")]
pub struct ModelError(#[from] MjEditError);

pub struct Stage {
    pub data: MjData<Arc<MjModel>>,
    pub model: Arc<MjModel>,
    pub items: Vec<Item>,
    pieces: Vec<(usize, [f64; 3])>,
    /// The pane of the view; `None` for the direct one, in which panes are blank.
    pub(crate) pane: Option<usize>,
    beyond: usize,
    hand: usize,
    shown_at: u32,
}

impl Stage {
    /// The stages of a scene, for pictures of the configured size: the eye's direct view, then the view through each
    /// pane.
    pub fn all(config: &WorldConfig, scene: &Scene) -> Result<Vec<Self>, ModelError> {
        let model = compile(config)?;
        let panes = std::iter::once(None).chain((0..scene.panes.len()).map(Some));
        Ok(panes.map(|pane| Self::new(model.clone(), config, scene, pane)).collect())
    }

    fn new(mut model: MjModel, config: &WorldConfig, scene: &Scene, pane: Option<usize>) -> Self {
        let items: Vec<Item> = (0..model.geom_group().len()).map(|geom| item(&model, geom, scene)).collect();
        dress::dress(&mut model, &items, config, scene, pane);
        dress::show_at(&mut model, &items, scene, 1, pane);
        let moved = |name: &str| {
            let body = model.name_to_id(MjtObjBase::mjOBJ_BODY, name).expect("every model has this body");
            let mocap = usize::try_from(model.body_mocapid()[body]).expect("it is moved from outside");
            (mocap, model.body_pos()[body])
        };
        let names =
            (0..BODIES).flat_map(|body| Piece::ALL.map(|piece| format!("{}_{}", body_name(body), piece.name())));
        let pieces = names.map(|name| moved(&name)).collect();
        let (beyond, hand) = (moved(BEYOND_CAMERA).0, moved(HAND).0);
        let model = Arc::new(model);
        Self { data: MjData::new(Arc::clone(&model)), model, items, pieces, pane, beyond, hand, shown_at: 1 }
    }

    fn show_at(&mut self, scene: &Scene, t: u32) {
        if scene.shown_at(t) != scene.shown_at(self.shown_at) {
            let mut model = MjModel::clone(&self.model);
            dress::show_at(&mut model, &self.items, scene, t, self.pane);
            self.model = Arc::new(model);
            self.data.swap_model(Arc::clone(&self.model));
        }
        self.shown_at = t;
    }

    pub fn is_shown(&self, geom: usize) -> bool {
        self.model.geom_group()[geom] != group::HIDDEN
    }

    pub fn show(&mut self, config: &WorldConfig, scene: &Scene, moment: &SceneMoment) {
        const FAR_BELOW: f64 = -100.0;
        self.show_at(scene, moment.t);
        for (body, figure) in moment.bodies.iter().enumerate() {
            for (at, piece) in Piece::ALL.into_iter().enumerate() {
                let (mocap, joint) = self.pieces[body * Piece::ALL.len() + at];
                let (origin, rotation) = match figure {
                    Some(figure) => piece.place(figure, joint, &config.body),
                    None => ([joint[0], joint[1], FAR_BELOW], Quaternion([1.0, 0.0, 0.0, 0.0])),
                };
                self.data.mocap_pos_mut()[mocap] = origin;
                self.data.mocap_quat_mut()[mocap] = rotation.0;
            }
        }
        if let Some(pose) = moment.beyond {
            self.data.mocap_pos_mut()[self.beyond] = [pose.x, pose.y, config.eye.height];
            self.data.mocap_quat_mut()[self.beyond] = pose.heading.rotation().0;
        }
        self.data.mocap_pos_mut()[self.hand] = moment.hand.unwrap_or([0.0, 0.0, FAR_BELOW]);
        self.data.forward();
    }

    pub(super) fn piece_place(&self, number: usize) -> ([f64; 3], [f64; 4]) {
        let (mocap, _) = self.pieces[number];
        (self.data.mocap_pos()[mocap], self.data.mocap_quat()[mocap])
    }
}

fn body_name(body: usize) -> String {
    body.checked_sub(AGENTS).map_or_else(|| format!("agent{body}"), |pane| format!("double{pane}"))
}

/// The number of a thing in its name, after this prefix.
fn numbered(name: &str, prefix: &str) -> Option<usize> {
    name.strip_prefix(prefix)?.split('_').next()?.parse().ok()
}

fn item(model: &MjModel, geom: usize, scene: &Scene) -> Item {
    let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
    let numbered = |prefix| numbered(name, prefix);
    let marked = |wearer: usize| {
        let part = name.split_once("_mark_")?.1;
        scene.marks.iter().position(|mark| mark.wearer == wearer && mark.part.name() == part)
    };
    let front = || scene.marks.iter().position(|mark| mark.part == Part::Front);
    if name.contains(shadow::NAMED) {
        Item::Room
    } else if let Some(pane) = numbered("pane") {
        Item::Pane(pane)
    } else if name == PATCH {
        Item::Mark(front().unwrap_or(MOST_MARKS - 1))
    } else if name.starts_with(HAND) {
        Item::Hand
    } else if let Some(agent) = numbered("agent") {
        marked(agent).map_or(Item::Agent(agent), Item::Mark)
    } else if numbered("double").is_some() {
        Item::Double
    } else {
        numbered("cube").map_or(Item::Room, Item::Cube)
    }
}

/// A model without a scene, for pictures of the configured size.
pub(super) fn compile(config: &WorldConfig) -> Result<MjModel, ModelError> {
    let is_textured = config.look == mirrorstats_experiment::spec::Look::Textured;
    let mut spec =
        MjSpec::from_xml_string(&if is_textured { ROOM.replace("</asset>", PANELS) } else { ROOM.to_owned() })?;
    build_room(&mut spec, config);
    if is_textured {
        for wall in ["wall_east", "wall_north", "wall_west", "wall_south"] {
            spec.geom_mut(wall).expect("the room has this plane").set_material("panels");
        }
    }
    build_boxes(&mut spec, dress::FRAME, MOST_PANES * BARS, config.room.size);
    let largest = config.clutter.edges.iter().copied().fold(config.cubes.edge, f64::max);
    build_boxes(&mut spec, "cube", MOST_CUBES, largest);
    build_boxes(&mut spec, "pane", MOST_PANES, config.room.size);
    for body in 0..BODIES {
        let mut humanoid = MjSpec::from_xml_string(BodyModel::new(config.body.shape).xml)?;
        let prefix = format!("{}_", body_name(body));
        spec.world_body_mut().attach_by_deep_copy(&mut humanoid, &prefix, "")?;
    }
    if is_textured {
        shadow::build(&mut spec)?;
    }
    add_eyes(&mut spec, config);
    set_picture(&mut spec, &config.eye);
    light(&mut spec, &config.lights);
    Ok(spec.compile()?)
}

fn build_room(spec: &mut MjSpec, config: &WorldConfig) {
    let room = &config.room;
    let [half, middle] = [room.size / 2.0, room.height / 2.0];
    let floor = [half, half, 1.0];
    let wall = [middle, half, 1.0];
    let planes = [
        ("floor", floor, [0.0; 3], [1.0; 3]),
        ("ceiling", floor, [0.0, 0.0, room.height], room.ceiling_color),
        ("wall_east", wall, [half, 0.0, middle], room.wall_color),
        ("wall_north", wall, [0.0, half, middle], room.side_wall_color),
        ("wall_west", wall, [-half, 0.0, middle], room.wall_color),
        ("wall_south", wall, [0.0, -half, middle], room.side_wall_color),
    ];
    for (name, size, place, color) in planes {
        let geom = spec.geom_mut(name).expect("the room has this plane");
        *geom.size_mut() = size;
        *geom.pos_mut() = place;
        if name == "ceiling" {
            geom.set_group(group::CEILING);
        }
        *geom.rgba_mut() = rgba(color);
    }
    let tiles = spec.texture_mut("tiles").expect("the room has this texture");
    *tiles.rgb1_mut() = room.floor_color;
    *tiles.rgb2_mut() = room.tile_color;
    let material = spec.material_mut("floor").expect("the room has this material");
    // MuJoCo lays a texture of two by two tiles over twice this size.
    #[expect(clippy::cast_possible_truncation, reason = "a size of the room")]
    let repeats = (1.0 / room.tile_size) as f32;
    *material.texrepeat_mut() = [repeats, repeats];
}

fn rgba(color: [f64; 3]) -> [f32; 4] {
    #[expect(clippy::cast_possible_truncation, reason = "a part of a colour")]
    let [red, green, blue] = color.map(|part| part as f32);
    [red, green, blue, 1.0]
}

fn build_boxes(spec: &mut MjSpec, name: &str, count: usize, largest: f64) {
    for at in 0..count {
        let geom = spec.world_body_mut().add_geom();
        geom.set_name(&format!("{name}{at}")).expect("names of boxes differ");
        geom.set_type(MjtGeomBase::mjGEOM_BOX);
        *geom.size_mut() = [largest / 2.0; 3];
        *geom.pos_mut() = [0.0, 0.0, -50.0];
        // MuJoCo ignores a scene's rotation if it was invalid when compiled.
        let quarter = std::f64::consts::FRAC_1_SQRT_2;
        *geom.quat_mut() = [quarter, 0.0, -quarter, 0.0];
        geom.set_contype(1);
        geom.set_conaffinity(0);
        geom.set_material("matte");
    }
}

fn add_eyes(spec: &mut MjSpec, config: &WorldConfig) {
    let eye = &config.eye;
    let places =
        [(EYE_CAMERA, "agent0_trunk", [eye.forward, 0.0, eye.height]), (BEYOND_CAMERA, BEYOND_CAMERA, [0.0; 3])];
    for (name, body, place) in places {
        let camera = spec.body_mut(body).expect("every model has this body").add_camera();
        camera.set_name(name).expect("no other camera has this name");
        *camera.pos_mut() = place;
        // Right is -y and up is z; then the pitch about y.
        let level = Quaternion([0.5, 0.5, -0.5, -0.5]);
        *camera.quat_mut() = if eye.pitch > 0.0 { Quaternion::about_y(eye.pitch).after(level).0 } else { level.0 };
        camera.set_fovy(eye.fovy);
    }
    let top = spec.world_body_mut().add_camera();
    top.set_name(TOP_CAMERA).expect("no other camera has this name");
    *top.pos_mut() = [0.0, 0.0, config.room.height + 10.0];
    top.set_fovy(45.0);
}

fn set_picture(spec: &mut MjSpec, eye: &EyeConfig) {
    let visual = spec.visual_mut();
    let counts = [eye.width, eye.height_px, eye.samples, eye.slices, eye.stacks, eye.quads];
    let [width, height, samples, slices, stacks, quads] = counts.map(|count| i32::try_from(count).unwrap_or(i32::MAX));
    (visual.global.offwidth, visual.global.offheight) = (width, height);
    visual.quality.offsamples = samples;
    // Drawing time depends on the triangles of round parts, and a body is a few hundred pixels high at most.
    (visual.quality.numslices, visual.quality.numstacks, visual.quality.numquads) = (slices, stacks, quads);
}

/// Four equal lamps, one towards each wall, so that all walls are lit alike; one from below.
fn light(spec: &mut MjSpec, config: &LightsConfig) {
    #[expect(clippy::cast_possible_truncation, reason = "a part of a colour")]
    let [ambient, diffuse, lamp, floor] =
        [config.head_ambient, config.head_diffuse, config.lamp_diffuse, config.floor_diffuse]
            .map(|part| [part as f32; 3]);
    let head = &mut spec.visual_mut().headlight;
    (head.ambient, head.diffuse, head.specular) = (ambient, diffuse, [0.0; 3]);
    let (down, ahead) = sine_cosine(config.lamp_slope);
    let lamps = (0..4).map(|wall| {
        // Slightly off the walls' own directions, so that corners of cubes are visible.
        let [x, y] = Heading::new(3 * wall + 1).direction();
        ([ahead * x, ahead * y, -down], lamp)
    });
    for (direction, diffuse) in lamps.chain([([0.0, 0.0, 1.0], floor)]) {
        let light = spec.world_body_mut().add_light();
        light.set_type(mujoco_rs::prelude::MjtLightType::mjLIGHT_DIRECTIONAL);
        *light.dir_mut() = direction;
        *light.diffuse_mut() = diffuse;
        *light.specular_mut() = [0.0; 3];
        *light.ambient_mut() = [0.0; 3];
        light.set_castshadow(false);
    }
}
