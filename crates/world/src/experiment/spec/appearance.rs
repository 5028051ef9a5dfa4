//! The appearance of rooms and bodies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use exact::names;

/// How the room and its mirrors look. What is visible is the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Look {
    /// Walls of one grey each, mirrors without frame or tint.
    #[default]
    Plain,
    /// Walls of panels, soft shadows, mirrors with a frame of wood and a slight tint.
    Textured,
}

names!(Look { Plain: "plain", Textured: "textured" });

impl Look {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
    pub(crate) const fn is_plain(&self) -> bool {
        matches!(self, Self::Plain)
    }
}

/// The shape of all bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Body {
    /// Twenty-one parts, 1.6 m tall, with a neutral head and a face.
    #[default]
    Mannequin,
    /// The sizes of MuJoCo's standard humanoid: nineteen parts, 1.56 m tall, all in the body's colour.
    Humanoid,
}

names!(Body { Mannequin: "mannequin", Humanoid: "humanoid" });

#[cfg(feature = "sim")]
impl Body {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
    pub(crate) const fn is_mannequin(&self) -> bool {
        matches!(self, Self::Mannequin)
    }
}
