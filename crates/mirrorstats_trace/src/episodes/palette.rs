//! The ten colours of the study, for bodies, cubes and claims.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::names;

/// A colour of the palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Color {
    Blue,
    Brown,
    Cyan,
    Green,
    Orange,
    Pink,
    Purple,
    Red,
    White,
    Yellow,
}

names!(Color {
    Blue: "blue",
    Brown: "brown",
    Cyan: "cyan",
    Green: "green",
    Orange: "orange",
    Pink: "pink",
    Purple: "purple",
    Red: "red",
    White: "white",
    Yellow: "yellow",
});

impl Color {
    /// The paint of this colour: red, green and blue. Shading makes it darker in a picture.
    pub const fn rgb(self) -> [u8; 3] {
        match self {
            Self::Blue => [25, 60, 225],
            Self::Brown => [112, 60, 16],
            Self::Cyan => [0, 215, 230],
            Self::Green => [20, 160, 40],
            Self::Orange => [255, 125, 0],
            Self::Pink => [255, 130, 190],
            Self::Purple => [130, 30, 190],
            Self::Red => [215, 15, 20],
            Self::White => [255, 255, 255],
            Self::Yellow => [250, 225, 0],
        }
    }
}
