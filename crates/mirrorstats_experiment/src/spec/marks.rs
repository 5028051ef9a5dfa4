use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::names;
use mirrorstats_trace::schema::colors::Color;

/// A mark on a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// The part of the body.
    pub part: Part,
    /// Of its paint: a colour, or `random`, which is never that of its wearer.
    #[serde(default)]
    pub color: MarkColor,
    /// The first step that shows it, at most the experiment's `steps`.
    #[serde(default = "first")]
    #[schemars(range(min = 1, max = 100_000))]
    pub from_t: u32,
    /// The wearer.
    #[serde(default)]
    pub on: Wearer,
}

const fn first() -> u32 {
    1
}

/// The part of a body with a mark. No direct view reaches any of these on one's own body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The top of the head.
    Head,
    /// A square plate of 17 cm before the face: the largest, and always turned to what one looks into.
    Face,
    /// Between the shoulders, behind.
    Back,
    /// The chest.
    Chest,
    /// A square patch somewhere on the front, of a body that stands still; its place and its size are drawn.
    Front,
}

names!(Part { Head: "head", Face: "face", Back: "back", Chest: "chest", Front: "front" });

/// The colour of a mark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MarkColor {
    /// Drawn: never that of its wearer.
    #[default]
    Random,
    /// This one; another one where its wearer has this colour.
    #[serde(untagged)]
    Named(Color),
}

/// The wearer of a mark.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Wearer {
    /// The agent itself: to be reported.
    #[default]
    #[serde(rename = "self")]
    Own,
    /// The first of the others: not to be reported.
    #[serde(rename = "other")]
    Other,
}
