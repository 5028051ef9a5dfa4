//! The ten colours of the study: what a body, a cube and a claim can be.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A colour of the palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "each is the colour of its name")]
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

impl Color {
    /// All ten, by name.
    pub const ALL: [Self; 10] = [
        Self::Blue,
        Self::Brown,
        Self::Cyan,
        Self::Green,
        Self::Orange,
        Self::Pink,
        Self::Purple,
        Self::Red,
        Self::White,
        Self::Yellow,
    ];

    /// The name in traces and prompts.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Blue => "blue",
            Self::Brown => "brown",
            Self::Cyan => "cyan",
            Self::Green => "green",
            Self::Orange => "orange",
            Self::Pink => "pink",
            Self::Purple => "purple",
            Self::Red => "red",
            Self::White => "white",
            Self::Yellow => "yellow",
        }
    }

    /// What paint of this colour is: red, green and blue. In a picture it is darker by the light that falls on it.
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

    /// The colour of this name, as [`Color::name`] writes it.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|color| color.name() == name)
    }
}
