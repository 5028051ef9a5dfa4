//! Agents: they decide the next action.
//!
//! An agent gets only what a vision-language model gets: the frame and the words around it. It gets no pose of another
//! body, no label and no ground truth. It answers with a [`Reply`], which the recorder stores unchanged.
//!
//! Rule: an agent is a function of its task and its observations (and, for a model behind a network, of its answers).

#![warn(clippy::print_stdout, clippy::print_stderr)]

#[cfg(feature = "play")]
pub mod exec;
#[cfg(feature = "play")]
pub mod function;
#[cfg(feature = "play")]
pub mod harness;
#[cfg(all(feature = "play", feature = "view"))]
pub mod human;
#[cfg(feature = "play")]
pub mod json_lines;
#[cfg(feature = "play")]
pub mod perception;
pub mod prompt;
pub mod reparse;
pub mod reply;
#[cfg(feature = "play")]
pub mod scripted;
#[cfg(feature = "play")]
pub mod secrets;

use std::collections::BTreeMap;
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
#[cfg(feature = "play")]
use std::sync::{Mutex, MutexGuard, PoisonError};
#[cfg(feature = "play")]
use std::time::Duration;

use mirrorstats_exact::names;
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::answers::Answered;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::frame::Frame;
use reply::Repair;

/// The task that an agent gets once, before the first step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    pub experiment: Experiment,
    /// The false colour of the first line of the prompt in E3.
    pub stated_color: Option<String>,
    /// Steps after which the episode ends automatically (100 in the paper).
    pub step_budget: i32,
    /// The only source of randomness for an agent; differs between episodes, equal between recordings.
    pub seed: u64,
}

/// The perception of an agent before it acts.
#[derive(Clone, Debug)]
pub struct Observation {
    /// The timestep, from 1.
    pub t: i32,
    /// Steps left, this one included.
    pub remaining: i32,
    /// The position of the body, m, in the coordinates of the room.
    pub x: f32,
    pub y: f32,
    /// The direction of the body: degrees, counter-clockwise from +x, a multiple of 30.
    pub yaw: f32,
    pub bumped: bool,
    /// The previous step: its action, and the summary of the last reply with a decision; `None` at t = 1.
    pub history: Option<(Option<Action>, Option<String>)>,
    /// All previous steps in order; a prompt may include them.
    pub past: Arc<Vec<Past>>,
    pub frame: Arc<Frame>,
    /// The vertical field of view of the frame, degrees: 110 in the study. Only scripted agents use it; models and
    /// programs do not get it.
    pub fov_y: f64,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Past {
    /// The decided action; `None` if the reply gave no decision.
    pub action: Option<Action>,
    pub bumped: bool,
    pub thought: Option<String>,
}

/// An agent's answer, and how it was obtained.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reply {
    pub status: Status,
    pub repairs: Vec<Repair>,
    /// The reason for a missing decision, for people; `None` with a decision, or if the status says all.
    pub fault: Option<String>,
    /// The action; `None` if the reply gave none, so that the body stands still.
    pub action: Option<Action>,
    /// The self-attribution: a colour of the palette, `unknown`, or `None` if the reply gave none.
    pub self_color: Option<String>,
    /// The cube: a colour, `none`, or `None` if the reply gave none.
    pub selected_cube: Option<String>,
    /// The mark on the own body: a colour, `none`, or `None` if the reply gave none.
    pub mark_report: Option<String>,
    /// The answers that the experiment declares, by key; missing answers are absent.
    pub answers: Answers,
    pub words: Words,
    pub raw: Option<String>,
    pub usage: Usage,
    /// The model's id as the provider returned it; `None` without a provider.
    pub model: Option<String>,
}

pub type Answers = BTreeMap<String, Answered>;

/// The free text of a reply; in the paper, keys of the reply's JSON object.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Words {
    pub view_description: Option<String>,
    pub reasoning: Option<String>,
    /// `summary`; returned as the history of the next step.
    pub summary: Option<String>,
    /// `identification`, the source of the self-attribution.
    pub identification: Option<String>,
}

/// Time, tokens and money of one reply; `None` if not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// From sending the request to the whole reply, ms.
    pub latency_ms: Option<i32>,
    pub prompt_tokens: Option<i32>,
    pub completion_tokens: Option<i32>,
    pub cost_usd: Option<f64>,
}

impl Usage {
    #[cfg(feature = "play")]
    fn of_time(latency: Duration) -> Self {
        Self { latency_ms: Some(milliseconds(latency)), ..Self::default() }
    }
}

#[cfg(feature = "play")]
pub fn milliseconds(time: Duration) -> i32 {
    i32::try_from(time.as_millis()).unwrap_or(i32::MAX)
}

/// The outcome of getting and reading a reply: the values of the trace's `reply_status` column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Status {
    /// Valid as it came.
    #[default]
    Ok,
    /// Valid after a named repair.
    Repaired,
    /// Without a JSON object.
    ParseFailed,
    /// A JSON object other than the requested one.
    SchemaInvalid,
    Refusal,
    /// Cut off by the token limit.
    Truncated,
    Empty,
    /// The provider's rate limit, up to the last attempt.
    RateLimited,
    /// A provider failure, up to the last attempt.
    ServerError,
    /// No complete reply in time, up to the last attempt.
    Timeout,
}

names!(Status {
    Ok: "ok",
    Repaired: "repaired",
    ParseFailed: "parse_failed",
    SchemaInvalid: "schema_invalid",
    Refusal: "refusal",
    Truncated: "truncated",
    Empty: "empty",
    RateLimited: "rate_limited",
    ServerError: "server_error",
    Timeout: "timeout",
});

/// An episode that cannot continue for reasons outside the agent, such as failed infrastructure. It is counted
/// separately and recorded again by the next run of the command; it is never scored.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{cause}")]
pub struct Lost {
    /// The status of the reply, if the failure is one of a reply.
    pub status: Option<Status>,
    pub cause: String,
    /// The step that went wrong, if it precedes the one where the failure was noticed.
    pub step: Option<i32>,
    pub kind: LostKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LostKind {
    Failure,
    /// A spending limit is reached; the episode waits for a higher one.
    Limit,
    Stop,
    Leaving,
}

impl Lost {
    pub fn because(cause: impl Into<String>) -> Self {
        Self { status: None, cause: cause.into(), step: None, kind: LostKind::Failure }
    }

    /// Lost to the failure of a reply, which counts as this status.
    pub fn counted_as(status: Status, cause: impl Into<String>) -> Self {
        Self { status: Some(status), ..Self::because(cause) }
    }

    /// Lost to an observation that cannot be made.
    #[cfg(feature = "play")]
    fn unobservable(fault: impl std::fmt::Display) -> Self {
        Self::because(format!("the observation cannot be made: {fault}"))
    }

    pub fn by_limit(cause: impl Into<String>) -> Self {
        Self { kind: LostKind::Limit, ..Self::because(cause) }
    }

    pub fn by_stop() -> Self {
        Self { kind: LostKind::Stop, ..Self::because("the recording is being stopped") }
    }

    pub fn by_leaving() -> Self {
        Self { kind: LostKind::Leaving, ..Self::because("the participant has left the study") }
    }
}

/// Locks a mutex. No holder leaves its value half changed, so a panic of another thread does no harm.
#[cfg(feature = "play")]
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A decision that may take time: scripted agents are ready at once, others wait for a network or a program.
pub type Decision<'a> = Pin<Box<dyn Future<Output = Result<Reply, Lost>> + 'a>>;

pub type Farewell<'a> = Pin<Box<dyn Future<Output = ()> + 'a>>;

pub trait Agent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a>;

    fn end(&mut self, _ended: Ended) -> Farewell<'_> {
        Box::pin(std::future::ready(()))
    }

    /// The person who decides; `None` for other agents.
    fn person(&mut self) -> Option<&mut dyn Person> {
        None
    }
}

/// What only people need.
pub trait Person {
    fn code(&self) -> &str;

    fn wants_practice(&self) -> bool;

    /// Begins the practice with a task of its own, or ends it.
    fn practise(&mut self, task: Option<Task>);
}

/// The ending of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// The agent was done, or what was to be reached is reached.
    Done,
    /// The steps were used up.
    Budget,
    /// The recording is being stopped; the episode is recorded another time.
    Stopped,
}

/// The availability of an episode's player.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    Now,
    Later,
    /// No player is left for it.
    Never,
}

/// The player: makes the agent of each episode.
pub trait Player: Send + Sync {
    fn model(&self) -> &str;

    /// The description for recordings: everything that shapes the agent's decisions, and nothing that differs between
    /// starts of the same recording.
    fn description(&self) -> serde_json::Value;

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost>;

    /// Returns true if the agent looks at frames; others may get empty ones.
    fn looks(&self) -> bool {
        true
    }

    /// Returns true if its agents wait for something outside this process.
    fn waits(&self) -> bool {
        false
    }

    /// The reason why it can play no further episode.
    fn stopped(&self) -> Option<String> {
        None
    }

    /// Ends what its agents have started outside this process, which ends at once.
    fn abandon(&self) {}
}
