//! The messages to a program: one JSON object per line on its standard input.
//!
//! ```text
//! mirrorstats            program
//!   task         ──►
//!   observation  ──►
//!                ◄──  reply        (the JSON object of the paper's prompt, on one line)
//!   observation  ──►
//!                ◄──  reply
//!   end          ──►               (then standard input is closed)
//! ```
//!
//! Rule: what a model behind a provider gets, and nothing else: no body's true colour, no pose of another body, no count
//! of pixels, and before the end no seed or run, from which colours could be computed.

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;

use crate::Ended;
use crate::json_lines;

/// The version of the messages and of the order they come in.
pub(crate) const PROTOCOL: u32 = 1;

/// One line to the program.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Message {
    /// The first line: what the episode is about. It asks for no reply.
    Task(TaskMessage),
    /// The perception before a step. It asks for one line: the reply.
    Observation(ObservationMessage),
    /// The last line: nothing more is asked. It asks for no reply.
    End(EndMessage),
}

/// The task of an episode.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TaskMessage {
    /// The version of this protocol.
    pub protocol: u32,
    /// The prompt: `cube_selection` or `exploration` for the paper's two, the name of its folder for another.
    pub family: String,
    /// The false colour that the prompt states in E3; null elsewhere.
    pub stated_color: Option<String>,
    /// Steps after which the episode ends automatically.
    pub max_steps: i32,
    /// A number to draw chances from: differs between episodes, is the same in every recording of an episode. It is a
    /// hash, so it does not say which scene this is.
    pub seed: u64,
    /// The system prompt that a model gets.
    pub system_prompt: String,
    /// The JSON Schema of a reply: its keys and their types, as providers get it.
    pub reply_schema: Value,
}

/// The perception before a step.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ObservationMessage {
    /// The step, from 1.
    pub t: i32,
    /// Steps left, this one included.
    pub remaining_steps: i32,
    /// The position of the body, m, in the coordinates of the room.
    pub position: Position,
    /// The direction of the body: degrees, counter-clockwise from +x.
    pub orientation: f32,
    /// True if the last move was blocked.
    pub wall_warning: bool,
    /// The action of the step before: w, s, a, d; null at t = 1 and after a reply that could not be used.
    pub last_action: Option<String>,
    /// The `summary` of the last reply that could be used; null where there was none.
    pub last_thought: Option<String>,
    /// The user prompt that a model gets: task, history, position, warning.
    pub user_prompt: String,
    /// The view of the eye.
    pub image: Image,
}

/// A place on the floor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Position {
    /// m.
    pub x: f32,
    /// m.
    pub y: f32,
}

/// A frame as PNG.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Image {
    /// A file, which is there until the episode ends.
    Path(String),
    /// The bytes in base64.
    Base64(String),
}

/// That nothing more is asked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct EndMessage {
    /// The episode's id, for the program's own records: with its experiment, seed and run.
    pub episode_id: String,
    /// The ending of the episode.
    pub reason: Ended,
    /// The steps that were asked for.
    pub steps: i32,
}

impl Message {
    pub fn line(&self) -> serde_json::Result<Vec<u8>> {
        json_lines::line(self)
    }
}
