//! The sizes, speeds, lights and thresholds of the world, from one documented file.
//!
//! `assets/world/default.toml` is the world of the study. A user's file overrides its values.
//! Rule: a loaded configuration is valid; unknown keys, wrong types, values out of range and inconsistent keys are
//! rejected. The hash covers the values, not the text.

mod experiment;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Value;

use mirrorstats_exact::budget::Limit;
use mirrorstats_exact::hash;
use mirrorstats_exact::input;
use mirrorstats_experiment::angle::sine_cosine;
use mirrorstats_experiment::spec::{Body, Look, is_default};
use mirrorstats_toml_spec::{At, Fault, Faults, Shape, Source, lay};

const DEFAULT: &str = include_str!("../../../../assets/world/default.toml");

/// The default, which a test of this module loads like any other file.
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
    /// The shape and the movement of bodies.
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
    /// The placement of things at the start.
    pub placement: PlacementConfig,
    /// The criterion of mirror evidence.
    pub evidence: EvidenceConfig,
    /// The length of an episode.
    pub episode: EpisodeConfig,
    /// How the room and its mirrors look; experiments say it.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(skip)]
    pub look: Look,
}

/// The closed square room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoomConfig {
    /// From wall to wall, m.
    #[schemars(range(min = 5.0, max = 12.0))]
    pub size: f64,
    /// From floor to ceiling, m.
    #[schemars(range(min = 2.0, max = 5.0))]
    pub height: f64,
    /// Every other tile of the floor.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub floor_color: [f64; 3],
    /// The tiles between.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub tile_color: [f64; 3],
    /// Edge of a tile, m.
    #[schemars(range(min = 0.1, max = 2.0))]
    pub tile_size: f64,
    /// The walls at +x and -x.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub wall_color: [f64; 3],
    /// The walls at +y and -y.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub side_wall_color: [f64; 3],
    /// The ceiling.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub ceiling_color: [f64; 3],
}

/// The reflective surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MirrorConfig {
    /// Along the wall, m.
    #[schemars(range(min = 0.5, max = 10.0))]
    pub width: f64,
    /// m.
    #[schemars(range(min = 0.5, max = 5.0))]
    pub height: f64,
    /// The height of its centre, m.
    pub center_height: f64,
    /// Between its face and the wall, m.
    #[schemars(range(min = 0.005, max = 0.1))]
    pub gap: f64,
}

/// The shape and the movement of bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyConfig {
    /// The shape of all bodies, where the experiment does not say it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub shape: Body,
    /// Of the upright cylinder that is a body to walls, cubes and other bodies, m.
    #[schemars(range(min = 0.39, max = 0.6))]
    pub radius: f64,
    /// Of the agent's own steps, m.
    #[schemars(range(min = 0.1, max = 1.0))]
    pub step_length: f64,
    /// Of each leg after a step, degrees.
    #[schemars(range(min = 0.0, max = 15.0))]
    pub leg_swing: f64,
    /// Of each arm after a step, degrees.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub arm_swing: f64,
}

/// The first-person camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EyeConfig {
    /// Before the body's axis, m.
    #[schemars(range(min = 0.12, max = 0.25))]
    pub forward: f64,
    /// Above the floor, m.
    #[schemars(range(min = 1.4, max = 1.58))]
    pub height: f64,
    /// The vertical field of view, degrees.
    #[schemars(range(min = 30.0, max = 115.0))]
    pub fovy: f64,
    /// The camera's pitch below the horizon, degrees; only for experiments whose camera is not the eye.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(range(min = 0.0, max = 0.0))]
    pub pitch: f64,
    /// Pixels in a row.
    #[schemars(range(min = 16, max = 1920))]
    pub width: u32,
    /// Rows.
    #[schemars(range(min = 12, max = 1440))]
    pub height_px: u32,
    /// Samples per pixel when drawing.
    #[schemars(range(min = 0, max = 16))]
    pub samples: u32,
    /// Slices of a round part when drawing, about its axis.
    #[schemars(range(min = 6, max = 64))]
    pub slices: u32,
    /// Slices along its axis.
    #[schemars(range(min = 4, max = 64))]
    pub stacks: u32,
    /// Divisions of a flat part.
    #[schemars(range(min = 1, max = 16))]
    pub quads: u32,
}

/// The light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightsConfig {
    /// From everywhere.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub head_ambient: f64,
    /// From the eye.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub head_diffuse: f64,
    /// From each of the four lamps, one per wall.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub lamp_diffuse: f64,
    /// The lamps' slope below the horizon, degrees.
    #[schemars(range(min = 0.0, max = 85.0))]
    pub lamp_slope: f64,
    /// From below.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub floor_diffuse: f64,
}

/// The three candidates of E1 to E4.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CubesConfig {
    /// m.
    #[schemars(range(min = 0.2, max = 1.0))]
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
    /// The least number.
    #[schemars(range(min = 1, max = 6))]
    pub least: u32,
    /// The largest number.
    #[schemars(range(min = 1, max = 6))]
    pub most: u32,
    /// Of their steps, m.
    #[schemars(range(min = 0.05, max = 0.6))]
    pub step_length: f64,
    /// Of a hundred others, those in the colour of a candidate, each candidate equally often; the rest have any colour.
    #[schemars(range(min = 0, max = 100))]
    pub twin_percent: u32,
    /// Ticks that one waits for a body in its way before it turns away.
    #[schemars(range(min = 0, max = 100))]
    pub patience: u32,
}

/// The cubes of E5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClutterConfig {
    /// The least number.
    #[schemars(range(min = 0, max = 12))]
    pub least: u32,
    /// The largest number.
    #[schemars(range(min = 0, max = 12))]
    pub most: u32,
    /// The sizes to draw from, m.
    #[schemars(length(min = 1, max = 16), inner(range(min = 0.2, max = 1.0)))]
    pub edges: Vec<f64>,
    /// Of a hundred cubes, those that stand before the mirror.
    #[schemars(range(min = 0, max = 100))]
    pub before_mirror_percent: u32,
    /// Of a hundred cubes, those that have another on top.
    #[schemars(range(min = 0, max = 100))]
    pub stack_percent: u32,
    /// Of a hundred places before the mirror, those from which they hide half of the body or more, at least.
    #[schemars(range(min = 0, max = 100))]
    pub hides_percent: u32,
    /// Between the mirror's wall and the centre of a cube before it at most, m.
    pub mirror_distance: f64,
}

/// The placement of things at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlacementConfig {
    /// Between a cube, or the mirror's edge, and the next wall at least, m.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub wall_margin: f64,
    /// Between a body and anything else at the start at least, m.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub clearance: f64,
}

/// The criterion of mirror evidence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EvidenceConfig {
    /// Pixels that show the own body by way of the mirror, at least.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub mirror_self_px: u32,
}

/// The length of an episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EpisodeConfig {
    /// Steps after which it ends automatically.
    #[schemars(range(min = 1, max = 100_000))]
    pub steps: u32,
}

#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    #[error("world configuration {}: cannot read the file: {source}", path.display())]
    Unreadable { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Faults(#[from] Faults),
}

impl EyeConfig {
    /// Half of the width and of the height of the view at one metre, m.
    pub(crate) fn half_extent(&self) -> [f64; 2] {
        let (sine, cosine) = sine_cosine(self.fovy / 2.0);
        let high = sine / cosine;
        [high * f64::from(self.width) / f64::from(self.height_px), high]
    }
}

impl Default for WorldConfig {
    fn default() -> Self {
        DEFAULT_CONFIG.clone()
    }
}

/// A world is written by hand.
const LARGEST: Limit = Limit::new("bytes of a world", 1 << 20);

impl WorldConfig {
    /// The text of the default, which explains each key.
    pub const fn default_text() -> &'static str {
        DEFAULT
    }

    /// The default, overridden by a file's values.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text =
            input::text(path, LARGEST).map_err(|source| ConfigError::Unreadable { path: path.to_owned(), source })?;
        Ok(Self::read(Source { name: path.display().to_string(), text })?)
    }

    pub fn from_toml(text: &str) -> Result<Self, Faults> {
        Self::read(Source { name: "world configuration".to_owned(), text: text.to_owned() })
    }

    fn read(source: Source) -> Result<Self, Faults> {
        let source = Arc::new(source);
        let (root, mut faults) = mirrorstats_toml_spec::parse(&source);
        let at = At::root(&source, &root);
        let is_toml = faults.is_empty();
        let own = is_toml.then(|| Shape::of::<Self>().overlay().value(&at, "a world", &mut faults)).flatten();
        if !faults.is_empty() {
            return Err(Faults(faults).in_order());
        }
        let mut merged = Value::Table(DEFAULT.parse().expect("the built-in configuration is tested to load"));
        if let Some(own) = own {
            lay(&mut merged, own);
        }
        let config: Self = merged.try_into().expect("values of the schema, over those of the default");
        let faults = config.relations(&at);
        if faults.is_empty() { Ok(config) } else { Err(Faults(faults).in_order()) }
    }

    fn relations(&self, at: &At<'_>) -> Vec<Fault> {
        let Self { room, mirror, cubes, others, clutter, placement, .. } = self;
        let above = room.height - mirror.height / 2.0;
        let limits = [
            (["mirror", "width"], mirror.width, 0.5, room.size - 2.0 * placement.wall_margin),
            (["mirror", "center_height"], mirror.center_height, mirror.height / 2.0, above),
            (["others", "least"], f64::from(others.least), 1.0, f64::from(others.most)),
            (["clutter", "least"], f64::from(clutter.least), 0.0, f64::from(clutter.most)),
            (["cubes", "spacing"], cubes.spacing, 1.5 * cubes.edge, (room.size / 3.0 * 100.0).floor() / 100.0),
            (
                ["cubes", "mirror_distance"],
                cubes.mirror_distance,
                cubes.edge / 2.0 + placement.wall_margin,
                room.size / 2.0,
            ),
            (["clutter", "mirror_distance"], clutter.mirror_distance, 1.0, room.size / 2.0),
        ];
        let fault = |([table, key], value, least, most): ([&str; 2], f64, f64, f64)| {
            // This form also rejects NaN.
            let holds = value >= least && value <= most;
            let message = format!("`{table}.{key}` may be {least} to {most}, but is {value}");
            (!holds).then(|| at.key(table).key(key).fault(message))
        };
        limits.into_iter().filter_map(fault).collect()
    }

    /// SHA-256 of the values, 64 hexadecimal digits: the same for files with equal values.
    pub fn hash(&self) -> String {
        hash::of_bytes(serde_json::json!(self).to_string().as_bytes())
    }
}

pub fn metres(millimetres: u32) -> f64 {
    f64::from(millimetres) / 1000.0
}

#[cfg(test)]
mod tests;
