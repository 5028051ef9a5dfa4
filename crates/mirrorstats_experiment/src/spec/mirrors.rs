use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Wall, is_default};
use mirrorstats_exact::names;
use mirrorstats_trace::schema::colors::Color;

/// A mirror, or something in a mirror's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pane {
    /// Its kind.
    pub kind: PaneKind,
    /// Steps by which it is late.
    #[serde(default, skip_serializing_if = "is_default")]
    pub delay: u32,
    /// The colour of the body that it shows.
    #[serde(default, skip_serializing_if = "is_default")]
    pub color: Paint,
    /// Whose motion the body that it shows has.
    #[serde(default, skip_serializing_if = "is_default")]
    pub body: BodyShown,
    /// Its wall.
    #[serde(default)]
    pub wall: Wall,
    /// Along the wall, mm; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width_mm: Option<u32>,
    /// mm; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_mm: Option<u32>,
    /// Its lower edge above the floor, mm; about the world's height of centres if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bottom_mm: Option<u32>,
    /// The first step that shows it; the first of all if absent. Before it the wall is bare.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_t: Option<u32>,
    /// The last step that shows it; the last of all if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_t: Option<u32>,
    /// True if it has a frame of wood.
    #[serde(default, skip_serializing_if = "is_default")]
    pub frame: bool,
}

/// The kind of a pane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PaneKind {
    /// The room, as it is.
    Mirror,
    /// The room, as it was some steps ago.
    Delayed,
    /// The room, with the own body in another colour or with another body in its place.
    Decoy,
    /// A second room like the first, without cubes and others, where one body walks about.
    Window,
}

names!(PaneKind { Mirror: "mirror", Delayed: "delayed", Decoy: "decoy", Window: "window" });

/// The colour of something, in terms of the own body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Paint {
    /// The own body's.
    #[default]
    Own,
    /// Another: in a mirror that of another candidate where there are candidates; behind a window, which is seen without a
    /// mirror, that of no candidate.
    Other,
    /// This one.
    #[serde(untagged)]
    Named(Color),
}

/// Whose motion a body has that a decoy shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BodyShown {
    /// The agent's own.
    #[default]
    Own,
    /// Its own: it walks about, whatever the agent does.
    Independent,
}
