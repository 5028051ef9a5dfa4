//! One recorded episode: its constants, and its steps in order.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::episodes::answers::Answered;

/// The steps of one episode. Its JSON holds the constants alone, as logs do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Head", description = "The constants of an episode; the columns of the same names.")]
pub struct Episode {
    pub episode_id: String,
    pub model: String,
    pub experiment: String,
    pub seed: i32,
    pub run: i32,
    pub body_color: String,
    pub stated_color: Option<String>,
    pub distractors: Option<i8>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repetition: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decision: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingerprint: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub participant: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub episode_hash: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_distance: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unreadable_answers: Option<i32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shown_color: Option<String>,
    /// The steps t = 1..T in order; never empty where an episode is whole.
    #[serde(skip)]
    pub steps: Vec<Step>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    pub action: Option<Action>,
    pub self_color: Option<String>,
    pub selected_cube: Option<String>,
    pub mirror_visible: bool,
    pub extra: Extra,
}

mirrorstats_exact::names! {
    /// An agent's action: the five actions of the study, and the six of a hand.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum Action {
        MoveForward = "move_forward",
        MoveBackward = "move_backward",
        /// 30 degrees counter-clockwise.
        TurnLeft = "turn_left",
        /// 30 degrees clockwise.
        TurnRight = "turn_right",
        /// The decision, which ends the episode for the agent.
        Done = "done",
        HandUp = "hand_up",
        HandDown = "hand_down",
        HandLeft = "hand_left",
        HandRight = "hand_right",
        HandForward = "hand_forward",
        HandBackward = "hand_backward",
    }
}

impl Action {
    /// The actions of a walking body, in the order of the documentation.
    pub const WALK: [Self; 5] = [Self::MoveForward, Self::MoveBackward, Self::TurnLeft, Self::TurnRight, Self::Done];

    /// The actions of a hand, in the order of their numbers in a prompt.
    pub const HAND: [Self; 6] =
        [Self::HandUp, Self::HandDown, Self::HandLeft, Self::HandRight, Self::HandForward, Self::HandBackward];
}

macro_rules! optional {
    ($(#[$about:meta])+ $name:ident { $($field:ident: $type:ty,)+ }) => {
        $(#[$about])+
        pub struct $name {
            $(#[serde(default, skip_serializing_if = "Option::is_none")] pub $field: Option<$type>,)+
            /// The columns that an experiment's own answers have, by name. In a message they are keys beside the others.
            #[serde(skip)]
            pub answers: BTreeMap<String, Answered>,
        }
    };
}

optional! {
    /// The optional columns that vary from step to step; names, types and units as in the schema.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    Extra {
        mirror_self_px: i32,
        mirror_other_px: i32,
        mirror_px: i32,
        direct_other_px: i32,
        pose_x: f32,
        pose_y: f32,
        pose_yaw: f32,
        bumped: bool,
        cube_distance: f32,
        reply_status: String,
        reply_repair: String,
        reply_fault: String,
        view_description: String,
        reasoning: String,
        summary: String,
        identification: String,
        reply: String,
        latency_ms: i32,
        prompt_tokens: i32,
        completion_tokens: i32,
        cost_usd: f64,
        frame_time: i64,
        frame_digest: String,
        mark_color: String,
        mark_report: String,
        mirror_mark_px: i32,
        mirror_double_px: i32,
        shown_px: i32,
        pane1_body_px: i32,
        pane2_body_px: i32,
        pane3_body_px: i32,
        pane4_body_px: i32,
        mark1_px: i32,
        mark2_px: i32,
        mark3_px: i32,
        mark4_px: i32,
        target_distance: i32,
        answer: String,
        answer_truth: String,
    }
}
