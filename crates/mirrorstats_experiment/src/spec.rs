//! A validated experiment: every value is in range and consistent with the others.

mod answers;
mod layout;
mod marks;
mod mirrors;

use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mirrorstats_exact::chance::Chance;
use mirrorstats_exact::names;

pub use answers::{Answer, AnswerType, Fact, Side, UNKNOWN};
pub use layout::{Behavior, Colors, Cubes, Layout, Occluders, Others, Start, Wall};
pub use marks::{Mark, MarkColor, Part, Wearer};
pub use mirrors::{BodyShown, Paint, Pane, PaneKind};

/// The maximum number of glass panes (mirrors and windows) in a room.
pub const MOST_PANES: usize = 4;

pub const MOST_MARKS: usize = 4;

/// An experiment: what its world shows, what its agent is asked, and how the answer is decided.
///
/// Whole in the footer of every trace, under `mirrorstats.recording.experiment`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Experiment")]
pub struct Spec {
    /// Its name in traces, files and tables: letters, digits, `-` and `_`.
    pub name: String,
    /// The heading of its group in tables, without its name.
    pub title: String,
    /// Its position among experiments; after those that have one if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<i64>,
    /// Chance levels by metric: a fraction such as `1/3`, one for each blind strategy, or `none`.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub chance: IndexMap<String, Chance>,
    /// The rates of blind strategies, by metric, where no chance level applies.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub reference: IndexMap<String, Vec<String>>,
    /// The experiment whose scenes it has: its own name, or that of the one with which it makes pairs.
    pub scenes: String,
    /// The layout, shared by all experiments with these scenes.
    pub layout: Layout,
    /// The folder of its prompt: built in, or beside its file.
    pub prompt: String,
    /// SHA-256 of the prompt's templates, 64 hexadecimal digits.
    pub prompt_hash: String,
    /// The keys of a reply, in the order of the prompt.
    pub reply: Vec<ReplyKey>,
    /// The keys that it declares itself, after the others; the first one decides if `decision` says `answer`.
    #[serde(default, rename = "answer", skip_serializing_if = "Vec::is_empty")]
    pub answers: Vec<Answer>,
    /// The definitions that score it: a built-in name, or a path relative to its file; the default ones if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub definitions: Option<String>,
    /// SHA-256 of the definition file, 64 hexadecimal digits; absent for built-in definitions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub definitions_hash: Option<String>,
    /// The column that holds the decision.
    pub decision: Decision,
    /// The column that holds what the decision should name.
    pub truth: Truth,
    /// The body's colour in the prompt.
    pub stated_color: Stated,
    /// The agent's actions.
    pub actions: Actions,
    /// The agent's camera.
    pub camera: CameraKind,
    /// Steps after which an episode ends automatically; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<u32>,
    /// The length of the agent's own steps, mm; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step_length_mm: Option<u32>,
    /// Mirrors and windows, the first of which is where the layout has its own; none is a bare wall.
    #[serde(default, rename = "mirror", skip_serializing_if = "Vec::is_empty")]
    pub panes: Vec<Pane>,
    /// Marks on bodies.
    #[serde(default, rename = "mark", skip_serializing_if = "Vec::is_empty")]
    pub marks: Vec<Mark>,
    /// The hand that moves in place of the body, where the task is to reach the mark on its front.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hand: Option<Hand>,
    /// The size and the angle of the picture; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<Picture>,
    /// Columns that have no meaning for the task: its traces have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub absent: Vec<AbsentColumn>,
    /// How the room and its mirrors look.
    #[serde(default, skip_serializing_if = "is_default")]
    pub look: Look,
    /// The shape of all bodies; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<Body>,
}

/// A column that traces have unless their experiments say that it has no meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AbsentColumn {
    /// The self-attribution: where no reply says who the agent takes itself for.
    SelfColor,
    /// The cube that is chosen: where there is none to choose.
    SelectedCube,
}

names!(AbsentColumn { SelfColor: "self_color", SelectedCube: "selected_cube" });

impl AbsentColumn {
    /// The key of a reply that would fill the column.
    pub const fn key(self) -> ReplyKey {
        match self {
            Self::SelfColor => ReplyKey::Identification,
            Self::SelectedCube => ReplyKey::SelectedCube,
        }
    }
}

/// A hand that floats freely, a step at a time, and what it takes to reach the mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// The length of its steps, mm.
    pub step_mm: u32,
    /// Steps from the mark at the start at least, along the three directions together.
    pub least: u32,
    /// The same at most.
    pub most: u32,
    /// Steps from the mark at which it is reached.
    pub within: u32,
    /// The steps of an episode beyond those from the start to the mark.
    pub extra_steps: u32,
}

/// The size, the angle and the height of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The vertical field of view, degrees.
    pub fovy: u32,
    /// The height of the eye above the floor, mm; the world's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eye_height_mm: Option<u32>,
}

/// A key of a reply; its value is a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReplyKey {
    /// The description of the image.
    #[serde(rename = "view-description")]
    ViewDescription,
    /// The reason for this action.
    Reasoning,
    /// The action.
    Action,
    /// The summary, which the next step gets as its history.
    Summary,
    /// The cube: a colour, or `none`.
    SelectedCube,
    /// The own body's colour in words.
    Identification,
    /// The mark on the own body: a colour, or `none`.
    Mark,
}

names!(ReplyKey {
    ViewDescription: "view-description",
    Reasoning: "reasoning",
    Action: "action",
    Summary: "summary",
    SelectedCube: "selected_cube",
    Identification: "identification",
    Mark: "mark",
});

/// The column that holds the decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// The cube that the reply selects.
    SelectedCube,
    /// The colour that the reply gives the own body.
    SelfColor,
    /// The mark that the reply reports on the own body.
    MarkReport,
    /// The distance of the hand from the mark: no reply names it.
    TargetDistance,
    /// The first answer that the experiment declares.
    Answer,
}

names!(Decision {
    SelectedCube: "selected_cube",
    SelfColor: "self_color",
    MarkReport: "mark_report",
    TargetDistance: "target_distance",
    Answer: "answer",
});

impl Decision {
    /// The key of a reply that fills the column; `None` for a declared answer.
    pub const fn key(self) -> Option<ReplyKey> {
        match self {
            Self::SelectedCube => Some(ReplyKey::SelectedCube),
            Self::SelfColor => Some(ReplyKey::Identification),
            Self::MarkReport => Some(ReplyKey::Mark),
            Self::TargetDistance => Some(ReplyKey::Action),
            Self::Answer => None,
        }
    }
}

/// The column that holds what the decision should name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Truth {
    /// The colour of the own body.
    BodyColor,
    /// The colour of the mark on the own body, `none` where there is none.
    MarkColor,
    /// The distance from the hand's start to the mark.
    StartDistance,
    /// What the experiment's first answer should be.
    AnswerTruth,
}

names!(Truth {
    BodyColor: "body_color",
    MarkColor: "mark_color",
    StartDistance: "start_distance",
    AnswerTruth: "answer_truth"
});

/// The body's colour in the prompt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stated {
    /// Nothing.
    #[default]
    None,
    /// The colour of another candidate: false.
    Candidate,
    /// The colour of no candidate, or without such a colour any but the body's: false.
    Random,
}

/// The agent's actions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Actions {
    /// Steps forward and back, turns by 30 degrees, and `done`.
    #[default]
    Walk,
    /// Steps of a hand: up, down, left, right, away from the camera and towards it. The body stands still.
    Hand,
}

/// The agent's camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "Camera")]
pub enum CameraKind {
    /// Its own eye, before its face.
    #[default]
    Eye,
    /// A camera behind the body and above it, which looks over its head: 1.1 m behind, 2.0 m high, aimed at a point 1.7 m
    /// above where the body stands.
    Behind,
}

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

pub fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Spec {
    pub const fn has_candidates(&self) -> bool {
        matches!(self.layout.cubes, Cubes::Candidates { .. })
    }

    pub fn keys(&self) -> Vec<&str> {
        let own = self.answers.iter().map(|answer| answer.key.as_str());
        self.reply.iter().map(|key| key.name()).chain(own).collect()
    }

    pub fn asks_for_cube(&self) -> bool {
        self.reply.contains(&ReplyKey::SelectedCube)
    }

    pub fn asks_for_identification(&self) -> bool {
        self.reply.contains(&ReplyKey::Identification)
    }

    pub fn asks_for_mark(&self) -> bool {
        self.reply.contains(&ReplyKey::Mark)
    }
}
