//! One recorded episode as a writer gives it: the constants of the episode and its steps in order.

/// What happened in one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Unique in a report.
    pub episode_id: String,
    /// The name shown in tables.
    pub model: String,
    /// `E1`..`E5`, or any name that a definition file knows.
    pub experiment: String,
    /// The seed of the episode's block of runs.
    pub seed: i32,
    /// The run within its seed.
    pub run: i32,
    /// The true colour of the body, c* in the paper.
    pub body_color: String,
    /// The false colour told to the agent, where one was (E3).
    pub stated_color: Option<String>,
    /// Other agents in the room, where known.
    pub distractors: Option<i8>,
    /// The steps t = 1..T in order; never empty.
    pub steps: Vec<Step>,
}

/// One timestep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    /// One of the five actions; `None` where the reply gave none.
    pub action: Option<Action>,
    /// The self-attribution: a colour, `unknown`, or `None` where the reply gave none.
    pub self_color: Option<String>,
    /// A colour, `none`, or `None` where the reply gave none.
    pub selected_cube: Option<String>,
    /// Ground truth: mirror evidence is in view.
    pub mirror_visible: bool,
    /// Everything that a recorder may add.
    pub extra: Extra,
}

/// The five actions of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Action {
    /// One step forward.
    MoveForward,
    /// One step backward.
    MoveBackward,
    /// 30 degrees counter-clockwise.
    TurnLeft,
    /// 30 degrees clockwise.
    TurnRight,
    /// The decision: the episode is over for the agent.
    Done,
}

impl Action {
    /// All five, in the order of the documentation.
    pub const ALL: [Self; 5] = [Self::MoveForward, Self::MoveBackward, Self::TurnLeft, Self::TurnRight, Self::Done];

    /// The name in the `action` column.
    pub const fn name(self) -> &'static str {
        match self {
            Self::MoveForward => "move_forward",
            Self::MoveBackward => "move_backward",
            Self::TurnLeft => "turn_left",
            Self::TurnRight => "turn_right",
            Self::Done => "done",
        }
    }
}

/// The optional columns that vary from step to step; names, types and units as in the schema.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is the column of its name, documented in `schema`")]
pub struct Extra {
    pub mirror_self_px: Option<i32>,
    pub mirror_other_px: Option<i32>,
    pub mirror_px: Option<i32>,
    pub direct_other_px: Option<i32>,
    pub pose_x: Option<f32>,
    pub pose_y: Option<f32>,
    pub pose_yaw: Option<f32>,
    pub bumped: Option<bool>,
    pub cube_distance: Option<f32>,
    pub reply_status: Option<String>,
    pub reply_repair: Option<String>,
    pub view_description: Option<String>,
    pub reasoning: Option<String>,
    pub summary: Option<String>,
    pub identification: Option<String>,
    pub reply: Option<String>,
    pub latency_ms: Option<i32>,
    pub prompt_tokens: Option<i32>,
    pub completion_tokens: Option<i32>,
    pub cost_usd: Option<f64>,
    pub frame_time: Option<i64>,
}
