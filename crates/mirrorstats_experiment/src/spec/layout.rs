use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Paint, is_default};
use mirrorstats_trace::schema::colors::Color;

/// The draws from seed and run, the same for all experiments that share scenes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// The draw of the body's colour.
    pub colors: Colors,
    /// The colours of bodies and cubes.
    pub palette: Vec<Color>,
    /// The cubes.
    pub cubes: Cubes,
    /// The other agents.
    pub others: Others,
    /// The agent's pose at the start.
    pub start: Start,
    /// The wall of the first pane.
    pub wall: Wall,
}

/// The draw of the body's colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Colors {
    /// Each colour equally often over the seeds and runs of a study, or once more.
    #[default]
    Balanced,
    /// Each alone.
    Random,
}

/// The cubes of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case", tag = "kind")]
pub enum Cubes {
    /// No cube.
    None,
    /// Cubes of different colours, one of them the body's.
    Candidates {
        /// The number of colours, at most the palette's; three if absent, or all colours of a palette of two.
        #[serde(default = "three")]
        #[schemars(range(min = 2, max = 10))]
        count: u32,
    },
    /// Cubes of any colours.
    Clutter {
        /// The places of the cubes.
        #[serde(default, skip_serializing_if = "is_default")]
        occluders: Occluders,
        /// The least number; the world's if absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(max = 12))]
        least: Option<u32>,
        /// The largest number; the world's if absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(max = 12))]
        most: Option<u32>,
        /// Of a hundred places before the first pane, those from which it hides half of the body or more, at least; if absent
        /// the world's, or none where the places are random.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(range(max = 100))]
        hides: Option<u32>,
    },
}

const fn three() -> u32 {
    3
}

/// The places of clutter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Occluders {
    /// Most stand before the first pane, and most have another cube on top.
    #[default]
    BeforeMirror,
    /// Each stands on the floor, anywhere.
    Random,
}

/// The other agents of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Others {
    /// The least number; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(max = 6))]
    pub least: Option<u32>,
    /// The largest number; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(max = 6))]
    pub most: Option<u32>,
    /// Their behaviour.
    #[serde(default)]
    pub behavior: Behavior,
    /// Of a hundred others, those in the colour of a candidate, each candidate equally often; the rest have any colour of
    /// the palette. The world's if absent; without candidates it changes nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(max = 100))]
    pub twin_percent: Option<u32>,
    /// The colour of their bodies. `own` is that of the agent's own body, which gives it away. `other` is drawn and that of
    /// no candidate, or without such a colour any but the own one. If absent drawn as `twin_percent` says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<Paint>,
}

/// The behaviour of other agents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Behavior {
    /// They walk about.
    #[default]
    Walk,
    /// They stand where they are.
    Stand,
}

/// The agent's pose at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// With the place of the first pane out of view.
    #[default]
    FacingAway,
    /// Anyhow.
    Any,
    /// Two metres before the middle of the first pane, or of its place, facing it.
    BeforeMirror,
}

/// A wall of the room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wall {
    /// Drawn.
    #[default]
    Random,
    /// Across from the first pane.
    Opposite,
    /// That of the first pane, beside it.
    Same,
    /// At +x.
    East,
    /// At +y.
    North,
    /// At -x.
    West,
    /// At -y.
    South,
}

impl Wall {
    /// Quarter turns counter-clockwise from the wall at +x; `None` if it is drawn.
    pub const fn quarter(self) -> Option<u8> {
        match self {
            Self::Random | Self::Opposite | Self::Same => None,
            Self::East => Some(0),
            Self::North => Some(1),
            Self::West => Some(2),
            Self::South => Some(3),
        }
    }
}
