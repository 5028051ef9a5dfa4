//! Every size, speed, light and threshold of the world, from one documented file.
//!
//! `assets/world/default.toml` is the world of the study. A file of one's own lies over it: it says what differs.
//! Rule: what is loaded has been checked; a key that is unknown, of another type or out of its range is refused with
//! the file, the line, the key and what it may be. The hash is of the values, not of the text that gave them.

mod limits;
mod overlay;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::experiment::Experiment;
use crate::experiment::spec::{Camera, Cubes, Others};
use exact::budget::Limit;
use exact::hash;
use exact::input;

const DEFAULT: &str = include_str!("../../../../../assets/world/default.toml");

/// The default, which a test of this module loads as any other.
static DEFAULT_CONFIG: LazyLock<WorldConfig> =
    LazyLock::new(|| toml::from_str(DEFAULT).expect("the built-in configuration is tested to load"));

/// The world's configuration. Lengths are metres, angles degrees, colours red, green and blue from 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldConfig {
    /// The closed square room, its centre at the origin.
    pub room: RoomConfig,
    /// The reflective surface.
    pub mirror: MirrorConfig,
    /// How humanoids move.
    pub body: BodyConfig,
    /// The first-person camera.
    pub eye: EyeConfig,
    /// The light.
    pub lights: LightsConfig,
    /// The three candidates of E1 to E4.
    pub cubes: CubesConfig,
    /// The other agents of E4 and E5.
    pub others: OthersConfig,
    /// The cubes of E5.
    pub clutter: ClutterConfig,
    /// Where things may start.
    pub placement: PlacementConfig,
    /// What counts as mirror evidence.
    pub evidence: EvidenceConfig,
    /// How long an episode is.
    pub episode: EpisodeConfig,
}

/// The closed square room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoomConfig {
    /// From wall to wall, m.
    pub size: f64,
    /// From floor to ceiling, m.
    pub height: f64,
    /// Every other tile of the floor.
    pub floor_color: [f64; 3],
    /// The tiles between.
    pub tile_color: [f64; 3],
    /// Edge of a tile, m.
    pub tile_size: f64,
    /// The walls at +x and -x.
    pub wall_color: [f64; 3],
    /// The walls at +y and -y.
    pub side_wall_color: [f64; 3],
    /// The ceiling.
    pub ceiling_color: [f64; 3],
}

/// The reflective surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorConfig {
    /// Along the wall, m.
    pub width: f64,
    /// m.
    pub height: f64,
    /// The height of its centre, m.
    pub center_height: f64,
    /// Between its face and the wall, m.
    pub gap: f64,
}

/// How humanoids move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyConfig {
    /// Of the upright cylinder that is a body to walls, cubes and other bodies, m.
    pub radius: f64,
    /// Of the agent's own steps, m.
    pub step_length: f64,
    /// Of each leg after a step, degrees.
    pub leg_swing: f64,
    /// Of each arm after a step, degrees.
    pub arm_swing: f64,
}

/// The first-person camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EyeConfig {
    /// Before the body's axis, m.
    pub forward: f64,
    /// Above the floor, m.
    pub height: f64,
    /// The vertical field of view, degrees.
    pub fovy: f64,
    /// How far below the horizon it looks, degrees; only experiments whose camera is not the eye have it.
    #[serde(default, skip_serializing_if = "is_level")]
    pub pitch: f64,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height_px: u32,
    /// Samples per pixel when drawing.
    pub samples: u32,
    /// Slices of a round part when drawing, about its axis.
    pub slices: u32,
    /// Slices along its axis.
    pub stacks: u32,
    /// Divisions of a flat part.
    pub quads: u32,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
fn is_level(pitch: &f64) -> bool {
    pitch.abs() <= 0.0
}

/// The light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightsConfig {
    /// From everywhere.
    pub head_ambient: f64,
    /// From the eye.
    pub head_diffuse: f64,
    /// From each of the four lamps, one per wall.
    pub lamp_diffuse: f64,
    /// How far below the horizon the lamps point, degrees.
    pub lamp_slope: f64,
    /// From below.
    pub floor_diffuse: f64,
}

/// The three candidates of E1 to E4.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubesConfig {
    /// m.
    pub edge: f64,
    /// Between two centres at least, m.
    pub spacing: f64,
    /// Between a centre and the mirror's wall at least, m.
    pub mirror_distance: f64,
}

/// The other agents of E4 and E5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OthersConfig {
    /// How many at least.
    pub least: u32,
    /// How many at most.
    pub most: u32,
    /// Of their steps, m.
    pub step_length: f64,
    /// Of a hundred episodes, those where one of them has the colour of the agent's own body.
    pub twin_percent: u32,
    /// Ticks that one waits for a body in its way before it turns away.
    pub patience: u32,
}

/// The cubes of E5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClutterConfig {
    /// How many at least.
    pub least: u32,
    /// How many at most.
    pub most: u32,
    /// The sizes to draw from, m.
    pub edges: Vec<f64>,
    /// Of a hundred cubes, those that stand before the mirror.
    pub before_mirror_percent: u32,
    /// Of a hundred cubes, those that have another on top.
    pub stack_percent: u32,
    /// Of a hundred places before the mirror, those from which they hide half of the body or more, at least.
    pub hides_percent: u32,
    /// Between the mirror's wall and the centre of a cube before it at most, m.
    pub mirror_distance: f64,
}

/// Where things may start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacementConfig {
    /// Between a cube, or the mirror's edge, and the next wall at least, m.
    pub wall_margin: f64,
    /// Between a body and anything else at the start at least, m.
    pub clearance: f64,
}

/// What counts as mirror evidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EvidenceConfig {
    /// Pixels that show the own body by way of the mirror, at least.
    pub mirror_self_px: u32,
}

/// How long an episode is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EpisodeConfig {
    /// Steps after which it ends by itself.
    pub steps: u32,
}

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ConfigError {
    #[error("world configuration {}: cannot read the file: {source}", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("world configuration {}: {fault}", path.display())]
    Faulty { path: PathBuf, fault: Fault },
}

/// One thing wrong with a configuration.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{text}", line.map_or_else(String::new, |line| format!("line {line}: ")))]
pub struct Fault {
    /// Where, from 1; `None` where the value is not of the file.
    pub line: Option<usize>,
    /// What was expected, what was found, what to do.
    pub text: String,
}

impl Default for WorldConfig {
    fn default() -> Self {
        DEFAULT_CONFIG.clone()
    }
}

/// A world is written by hand.
const LARGEST: Limit = Limit::new("bytes of a world", 1 << 20);

impl WorldConfig {
    /// The text of the default, with what each key means.
    pub const fn default_text() -> &'static str {
        DEFAULT
    }

    /// The default with a file's values over it.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text =
            input::text(path, LARGEST).map_err(|source| ConfigError::Unreadable { path: path.to_owned(), source })?;
        Self::from_toml(&text).map_err(|fault| ConfigError::Faulty { path: path.to_owned(), fault })
    }

    /// The default with the values of `text` over it.
    pub fn from_toml(text: &str) -> Result<Self, Fault> {
        let config = overlay::over_default(DEFAULT, text)?;
        match limits::first_fault(&config) {
            None => Ok(config),
            Some((key, words)) => Err(Fault { line: overlay::line_of(text, key), text: words }),
        }
    }

    /// The world as an experiment has it: what the experiment says of lengths and counts lies over this.
    #[must_use]
    pub fn of(&self, experiment: Experiment) -> Self {
        let mut world = self.clone();
        let put = |place: &mut u32, value: Option<u32>| *place = value.unwrap_or(*place);
        put(&mut world.episode.steps, experiment.steps);
        if let Some(millimetres) = experiment.step_length_mm {
            world.body.step_length = metres(millimetres);
        }
        if let Some(picture) = experiment.view {
            (world.eye.width, world.eye.height_px) = (picture.width, picture.height);
            world.eye.fovy = f64::from(picture.fovy);
        }
        if experiment.camera == Camera::Behind {
            (world.eye.forward, world.eye.height, world.eye.pitch) = BEHIND;
        }
        let Others { least, most, twin_percent, .. } = experiment.layout.others;
        put(&mut world.others.least, least);
        put(&mut world.others.most, most);
        put(&mut world.others.twin_percent, twin_percent);
        world.others.least = world.others.least.min(world.others.most);
        if let Cubes::Clutter { least, most, hides } = experiment.layout.cubes {
            put(&mut world.clutter.hides_percent, hides);
            put(&mut world.clutter.least, least);
            put(&mut world.clutter.most, most);
            world.clutter.least = world.clutter.least.min(world.clutter.most);
        }
        world
    }

    /// SHA-256 of the values, 64 hexadecimal digits: the same for files that say the same in other words.
    pub fn hash(&self) -> String {
        hash::of_bytes(serde_json::json!(self).to_string().as_bytes())
    }

    pub fn view_px(&self) -> usize {
        self.eye.width as usize * self.eye.height_px as usize
    }
}

/// The camera behind the body: before its axis and above the floor, m, and below the horizon, degrees: the slope of the
/// line from there to a point 1.7 m above where the body stands, 0.3 m down on 1.1 m ahead. No more digits than recordings keep.
const BEHIND: (f64, f64, f64) = (-1.1, 2.0, 15.255_118_7);

pub fn metres(millimetres: u32) -> f64 {
    f64::from(millimetres) / 1000.0
}

#[cfg(test)]
mod tests;
