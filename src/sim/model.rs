//! The world as MuJoCo has it: one model for all experiments, dressed for a scene and posed for a moment.
//!
//! Every world has seven humanoids, twelve cubes and a mirror. Those that a scene lacks are hidden: in a group that
//! neither picture nor rays include. So all models have one layout, and a renderer goes from world to world at no cost.
//! Rule: the sizes of planes never change after compiling, because a renderer keeps them as they were.

mod dress;

pub(super) use dress::labelled;

use std::sync::Arc;

use mujoco_rs::prelude::{Attach, MjData, MjEditError, MjModel, MjSpec, MjtGeomBase, MjtObjBase, SpecItem};

use super::angle::{Heading, Quaternion, sine_cosine};
use super::body::{Figure, Piece};
use super::config::{LightsConfig, WorldConfig};
use super::scene::{MOST_CUBES, MOST_OTHERS, Scene};

/// Humanoids in every model: the agent's own body, then the others.
pub const AGENTS: usize = 1 + MOST_OTHERS;

/// The camera that is the agent's eye.
pub const EYE_CAMERA: &str = "eye";

/// The camera that sees the room from above.
pub const TOP_CAMERA: &str = "top";

/// Groups that MuJoCo's pictures and rays tell apart.
pub mod group {
    /// Walls, floor and the mirror.
    pub const ROOM: i32 = 0;
    /// Cubes and other agents.
    pub const THINGS: i32 = 1;
    /// The agent's own body.
    pub const EGO: i32 = 2;
    /// The ceiling, through which the view from above looks.
    pub const CEILING: i32 = 3;
    /// What a scene has not; by MuJoCo's default not drawn.
    pub const HIDDEN: i32 = 5;
}

const ROOM: &str = include_str!("../../assets/world/room.xml");
const HUMANOID: &str = include_str!("../../assets/world/humanoid.xml");

/// How a model is painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paint {
    /// As the agent sees it: lit.
    Lit,
    /// Every pixel exactly the colour of what it shows: no light, no shade, no smoothing.
    Labels,
}

/// What a geom is part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Item {
    /// The reflective surface.
    Mirror,
    /// Walls, floor or ceiling.
    Room,
    /// A humanoid: 0 is the agent's own body.
    Agent(usize),
    /// A cube of the scene.
    Cube(usize),
}

/// Why MuJoCo could not build the world.
#[derive(Debug, thiserror::Error)]
#[error("mujoco cannot build the world: {0}; the configuration or the library is at fault")]
pub struct ModelError(#[from] MjEditError);

/// A model dressed for a scene, and its state.
pub struct Stage {
    /// MuJoCo's state.
    pub(super) data: MjData<Arc<MjModel>>,
    /// The model of that state, shared with whoever draws it.
    model: Arc<MjModel>,
    items: Vec<Item>,
    /// Of each agent and piece: its index among the bodies that are moved from outside, and its joint.
    pieces: Vec<(usize, [f64; 3])>,
}

impl std::fmt::Debug for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stage").field("geoms", &self.items.len()).finish_non_exhaustive()
    }
}

impl Stage {
    /// The model of a scene, for pictures of the configured size.
    ///
    /// # Errors
    /// When MuJoCo refuses it.
    pub fn new(config: &WorldConfig, paint: Paint, scene: &Scene) -> Result<Self, ModelError> {
        let mut model = compile(config, paint, [config.eye.width as usize, config.eye.height_px as usize])?;
        let items: Vec<Item> = (0..model.geom_group().len()).map(|geom| item(&model, geom)).collect();
        dress::dress(&mut model, &items, config, scene);
        if paint == Paint::Labels {
            dress::label(&mut model, &items);
        }
        let pieces = (0..AGENTS)
            .flat_map(|agent| Piece::ALL.map(|piece| format!("agent{agent}_{}", piece.name())))
            .map(|name| {
                let body = model.name_to_id(MjtObjBase::mjOBJ_BODY, &name).expect("the humanoid has this piece");
                let mocap = usize::try_from(model.body_mocapid()[body]).expect("each piece is moved from outside");
                (mocap, model.body_pos()[body])
            })
            .collect();
        let model = Arc::new(model);
        Ok(Self { data: MjData::new(Arc::clone(&model)), model, items, pieces })
    }

    /// What each geom is part of.
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// MuJoCo's model, to draw with.
    pub(super) const fn shared_model(&self) -> &Arc<MjModel> {
        &self.model
    }

    /// MuJoCo's model.
    pub fn model(&self) -> &MjModel {
        self.data.model()
    }

    /// A geom's name, such as `mirror`, `cube3` or `agent0_head`.
    pub fn geom_name(&self, geom: usize) -> &str {
        self.data.model().id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default()
    }

    /// Whether a geom is in the scene.
    pub fn is_shown(&self, geom: usize) -> bool {
        self.data.model().geom_group()[geom] != group::HIDDEN
    }

    /// Puts the humanoids where they are; those that are not there far below the floor.
    pub fn pose(&mut self, config: &WorldConfig, figures: &[Figure]) {
        const FAR_BELOW: f64 = -100.0;
        for agent in 0..AGENTS {
            for (at, piece) in Piece::ALL.into_iter().enumerate() {
                let (mocap, joint) = self.pieces[agent * Piece::ALL.len() + at];
                let (origin, rotation) = match figures.get(agent) {
                    Some(figure) => piece.place(figure, joint, &config.body),
                    None => ([joint[0], joint[1], FAR_BELOW], Quaternion([1.0, 0.0, 0.0, 0.0])),
                };
                self.data.mocap_pos_mut()[mocap] = origin;
                self.data.mocap_quat_mut()[mocap] = rotation.0;
            }
        }
        self.data.forward();
    }

    /// Where a piece is: its number is that of its agent times five, plus its own.
    pub(super) fn piece_place(&self, number: usize) -> ([f64; 3], [f64; 4]) {
        let (mocap, _) = self.pieces[number];
        (self.data.mocap_pos()[mocap], self.data.mocap_quat()[mocap])
    }
}

/// What a geom's name says that it is part of.
fn item(model: &MjModel, geom: usize) -> Item {
    let name = model.id_to_name(MjtObjBase::mjOBJ_GEOM, geom).unwrap_or_default();
    let numbered = |prefix: &str| {
        let digits = name.strip_prefix(prefix)?.split('_').next()?;
        digits.parse::<usize>().ok()
    };
    match (name, numbered("agent"), numbered("cube")) {
        ("mirror", _, _) => Item::Mirror,
        (_, Some(agent), _) => Item::Agent(agent),
        (_, _, Some(cube)) => Item::Cube(cube),
        _ => Item::Room,
    }
}

/// A model for pictures of some size, everything in it and nothing dressed.
pub(super) fn compile(config: &WorldConfig, paint: Paint, size: [usize; 2]) -> Result<MjModel, ModelError> {
    let mut spec = MjSpec::from_xml_string(ROOM)?;
    build_room(&mut spec, config, paint);
    build_cubes(&mut spec, config, paint);
    for agent in 0..AGENTS {
        let mut humanoid = MjSpec::from_xml_string(HUMANOID)?;
        let prefix = format!("agent{agent}_");
        spec.world_body_mut().attach_by_deep_copy(&mut humanoid, &prefix, "")?;
    }
    add_eyes(&mut spec, config);
    set_picture(&mut spec, config, paint, size);
    match paint {
        Paint::Lit => light(&mut spec, &config.lights),
        Paint::Labels => unlight(&mut spec),
    }
    Ok(spec.compile()?)
}

fn build_room(spec: &mut MjSpec, config: &WorldConfig, paint: Paint) {
    let room = &config.room;
    let [half, middle] = [room.size / 2.0, room.height / 2.0];
    let floor = [half, half, 1.0];
    let wall = [middle, half, 1.0];
    let planes = [
        ("mirror", [config.mirror.height / 2.0, config.mirror.width / 2.0, 1.0], [half, 0.0, middle], [0.0; 3]),
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
        if name != "mirror" {
            *geom.rgba_mut() = rgba(color);
        }
    }
    let tiles = spec.texture_mut("tiles").expect("the room has this texture");
    *tiles.rgb1_mut() = room.floor_color;
    *tiles.rgb2_mut() = room.tile_color;
    let material = spec.material_mut("floor").expect("the room has this material");
    // MuJoCo lays a texture of two by two tiles over twice this size.
    #[expect(clippy::cast_possible_truncation, reason = "a size of the room")]
    let repeats = (1.0 / room.tile_size) as f32;
    *material.texrepeat_mut() = [repeats, repeats];
    if paint == Paint::Labels {
        spec.geom_mut("floor").expect("the room has this plane").set_material("");
    }
}

fn rgba(color: [f64; 3]) -> [f32; 4] {
    #[expect(clippy::cast_possible_truncation, reason = "a part of a colour")]
    let [red, green, blue] = color.map(|part| part as f32);
    [red, green, blue, 1.0]
}

fn build_cubes(spec: &mut MjSpec, config: &WorldConfig, paint: Paint) {
    let largest = config.clutter.edges.iter().copied().fold(config.cubes.edge, f64::max);
    for at in 0..MOST_CUBES {
        let geom = spec.world_body_mut().add_geom();
        geom.set_name(&format!("cube{at}")).expect("names of cubes differ");
        geom.set_type(MjtGeomBase::mjGEOM_BOX);
        *geom.size_mut() = [largest / 2.0; 3];
        *geom.pos_mut() = [0.0, 0.0, -50.0];
        geom.set_contype(1);
        geom.set_conaffinity(0);
        if paint == Paint::Lit {
            geom.set_material("matte");
        }
    }
}

fn add_eyes(spec: &mut MjSpec, config: &WorldConfig) {
    let eye = &config.eye;
    let trunk = spec.body_mut("agent0_trunk").expect("the agent has a trunk");
    let camera = trunk.add_camera();
    camera.set_name(EYE_CAMERA).expect("no other camera has this name");
    *camera.pos_mut() = [eye.forward, 0.0, eye.height];
    // Right is -y, up is z.
    *camera.quat_mut() = [0.5, 0.5, -0.5, -0.5];
    camera.set_fovy(eye.fovy);
    let top = spec.world_body_mut().add_camera();
    top.set_name(TOP_CAMERA).expect("no other camera has this name");
    *top.pos_mut() = [0.0, 0.0, config.room.height + 10.0];
    top.set_fovy(45.0);
}

fn set_picture(spec: &mut MjSpec, config: &WorldConfig, paint: Paint, size: [usize; 2]) {
    let visual = spec.visual_mut();
    let [width, height] = size.map(|pixels| i32::try_from(pixels).unwrap_or(i32::MAX));
    (visual.global.offwidth, visual.global.offheight) = (width, height);
    let samples = if paint == Paint::Lit { config.eye.samples } else { 0 };
    visual.quality.offsamples = i32::try_from(samples).unwrap_or(0);
}

/// Four equal lamps, one towards each wall, so that no wall is lit otherwise than another; one from below.
fn light(spec: &mut MjSpec, config: &LightsConfig) {
    #[expect(clippy::cast_possible_truncation, reason = "a part of a colour")]
    let [ambient, diffuse, lamp, floor] =
        [config.head_ambient, config.head_diffuse, config.lamp_diffuse, config.floor_diffuse]
            .map(|part| [part as f32; 3]);
    let head = &mut spec.visual_mut().headlight;
    (head.ambient, head.diffuse, head.specular) = (ambient, diffuse, [0.0; 3]);
    let (down, ahead) = sine_cosine(config.lamp_slope);
    let lamps = (0..4).map(|wall| {
        // A little off the walls' own directions, so that corners of cubes show.
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

/// Everything in its own colour, and the mirror all green over what it reflects.
fn unlight(spec: &mut MjSpec) {
    *spec.material_mut("mirror").expect("the room has this material").rgba_mut() = [0.0, 1.0, 0.0, 1.0];
    let visual = spec.visual_mut();
    let head = &mut visual.headlight;
    (head.ambient, head.diffuse, head.specular) = ([1.0; 3], [0.0; 3], [0.0; 3]);
}
