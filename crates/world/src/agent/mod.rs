//! Agents: they decide the next action.
//!
//! An agent gets what a vision-language model gets, the frame and the words around it, and nothing else: no pose of
//! another body, no label, no ground truth. It answers with a [`Reply`], which the recorder writes down as it is.
//!
//! Rule: an agent is a function of its task and its observations (and, for a model behind a network, of what that said).

#[cfg(feature = "sim")]
pub mod exec;
#[cfg(feature = "sim")]
pub mod function;
#[cfg(all(feature = "sim", feature = "view"))]
pub mod human;
#[cfg(feature = "sim")]
pub mod perception;
pub mod prompt;
pub mod reply;
#[cfg(feature = "sim")]
pub mod scripted;
#[cfg(feature = "sim")]
pub mod vlm;

use std::collections::{BTreeMap, BTreeSet};
use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;

use crate::experiment::Experiment;
use exact::names;
use reply::Repair;
use trace::answers::Answered;
use trace::episode::Action;
use trace::frame::Frame;

/// The task that an agent gets once, before the first step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    /// The experiment: its prompt and the keys of a reply.
    pub experiment: Experiment,
    /// The false colour of the first line of the prompt in E3.
    pub stated_color: Option<String>,
    /// Steps after which the episode ends automatically (100 in the paper).
    pub step_budget: i32,
    /// The only source of chance for an agent; differs from episode to episode, equal from recording to recording.
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
    /// See `x`.
    pub y: f32,
    /// The direction of the body: degrees, counter-clockwise from +x, a multiple of 30.
    pub yaw: f32,
    /// The last move was blocked.
    pub bumped: bool,
    /// The step before: what was done, and the summary of the last reply that gave a decision; `None` at t = 1.
    pub history: Option<(Option<Action>, Option<String>)>,
    /// All steps before, the first one first; a prompt may tell them all.
    pub past: Arc<Vec<Past>>,
    pub frame: Arc<Frame>,
    /// The vertical field of view of the frame, degrees: 110 in the study. For scripted agents alone: models and programs
    /// are not told.
    pub fov_y: f64,
}

/// A step that is over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Past {
    /// The decided action; `None` if the reply gave no decision.
    pub action: Option<Action>,
    pub bumped: bool,
    /// The summary of its reply.
    pub thought: Option<String>,
}

/// An agent's answer, and how it was obtained.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// The outcome of getting and reading it.
    pub status: Status,
    /// The repairs that were needed to read it, in order.
    pub repairs: Vec<Repair>,
    /// The reason why it gave no decision, for people; `None` where it gave one, or the status says all.
    pub fault: Option<String>,
    /// The action; `None` where the reply gave none: the body stands still.
    pub action: Option<Action>,
    /// The self-attribution: a colour of the palette, `unknown`, or `None` where the reply gave none.
    pub self_color: Option<String>,
    /// The cube: a colour, `none`, or `None` where the reply gave none.
    pub selected_cube: Option<String>,
    /// The mark on the own body: a colour, `none`, or `None` where the reply gave none.
    pub mark_report: Option<String>,
    /// The answers that the experiment declares, by key; without those that the reply gave none to.
    pub answers: Answers,
    /// The words around the decision, as given.
    pub words: Words,
    /// The whole reply, as it came.
    pub raw: Option<String>,
    pub usage: Usage,
    /// The id of the model as the provider returned it; `None` where no provider answers.
    pub model: Option<String>,
}

/// Answers by key.
pub type Answers = BTreeMap<String, Answered>;

/// The free text of a reply; the keys of the reply's JSON object in the paper.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Words {
    pub view_description: Option<String>,
    pub reasoning: Option<String>,
    /// `summary`; comes back as the history of the next step.
    pub summary: Option<String>,
    /// `identification`, of which the self-attribution is the normal form.
    pub identification: Option<String>,
}

/// Time, tokens and money of one reply; `None` where nobody counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Usage {
    /// From sending the request to the whole reply, ms.
    pub latency_ms: Option<i32>,
    /// Tokens of the request.
    pub prompt_tokens: Option<i32>,
    /// Tokens of the reply.
    pub completion_tokens: Option<i32>,
    /// US dollars.
    pub cost_usd: Option<f64>,
}

/// The outcome of getting and reading a reply: the values of the trace's `reply_status` column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Status {
    /// Valid as it came.
    Ok,
    /// Valid after a named repair.
    Repaired,
    /// No JSON object in it.
    ParseFailed,
    /// A JSON object, but not the one asked for.
    SchemaInvalid,
    Refusal,
    /// Cut off by the limit of tokens.
    Truncated,
    /// Nothing in it.
    Empty,
    /// The provider's limit of requests, to the last attempt.
    RateLimited,
    /// The provider failed, to the last attempt.
    ServerError,
    /// No whole reply in time, to the last attempt.
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

/// The episode cannot go on, and that is not the agent's doing: the infrastructure failed. Such an episode is counted
/// apart and recorded again by the next run of the command; it is never scored.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{cause}")]
pub struct Lost {
    /// The status of the reply, if the failure is one of a reply.
    pub status: Option<Status>,
    /// The failure, without any key.
    pub cause: String,
    /// The step that went wrong, where it is an earlier one than that at which it was noticed.
    pub step: Option<i32>,
    pub kind: LostKind,
}

/// Why an episode cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LostKind {
    /// Something failed.
    Failure,
    /// A limit of what may be spent is reached; the episode waits for a higher one.
    Limit,
    /// The recording is being stopped.
    Stop,
    /// The person who played it has left the study.
    Leaving,
}

impl Lost {
    /// Lost to something other than a reply.
    pub fn because(cause: impl Into<String>) -> Self {
        Self { status: None, cause: cause.into(), step: None, kind: LostKind::Failure }
    }

    /// Lost to the failure of a reply, which counts as this status.
    pub fn counted_as(status: Status, cause: impl Into<String>) -> Self {
        Self { status: Some(status), ..Self::because(cause) }
    }

    /// Stopped by a limit that a caller that records has set.
    pub fn by_limit(cause: impl Into<String>) -> Self {
        Self { kind: LostKind::Limit, ..Self::because(cause) }
    }

    /// Ended with the recording.
    pub fn by_stop() -> Self {
        Self { kind: LostKind::Stop, ..Self::because("the recording is being stopped") }
    }

    /// Ended with a person's part in the study.
    pub fn by_leaving() -> Self {
        Self { kind: LostKind::Leaving, ..Self::because("the participant has left the study") }
    }
}

/// A decision that may take its time: scripted agents are ready at once, others wait for a network or a program.
pub type Decision<'a> = Pin<Box<dyn Future<Output = Result<Reply, Lost>> + 'a>>;

/// The agent's work after its episode.
pub type Farewell<'a> = Pin<Box<dyn Future<Output = ()> + 'a>>;

/// One agent in one episode.
pub trait Agent {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a>;

    /// The code of the person who plays; `None` where no person does.
    fn participant(&self) -> Option<&str> {
        None
    }

    fn wants_practice(&self) -> bool {
        false
    }

    fn practise(&mut self, _task: Option<Task>) {}

    fn end(&mut self, _ended: Ended) -> Farewell<'_> {
        Box::pin(std::future::ready(()))
    }
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

/// An episode that a recording is to have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Planned {
    pub episode_id: String,
    pub experiment: String,
    pub seed: i32,
    pub repetition: i32,
    /// True if it is recorded already.
    pub is_recorded: bool,
}

/// When an episode can be played.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    Now,
    Later,
    /// Nobody is left who could play it.
    Never,
}

/// Who plays: makes the agent of each episode.
pub trait Player: Send + Sync {
    fn model(&self) -> &str;

    /// What goes into recordings: everything that shapes the agent's decisions, and nothing that differs from one start of
    /// the same recording to the next.
    fn description(&self) -> serde_json::Value;

    fn agent(&self, task: Task, episode_id: &str) -> Result<Box<dyn Agent>, Lost>;

    /// Returns true if the agent looks at frames; one that does not may be given empty ones.
    fn looks(&self) -> bool {
        true
    }

    /// Returns true if its agents wait for something outside of this process, so that a recording takes its time.
    fn waits(&self) -> bool {
        false
    }

    fn in_flight(&self) -> usize {
        1
    }

    fn most_in_flight(&self) -> usize {
        usize::MAX
    }

    /// Hears which episodes there are, before the first one is begun.
    fn plans(&self, _planned: &[Planned]) {}

    fn turn(&self, _episode_id: &str) -> Turn {
        Turn::Now
    }

    /// The recording is to stop: nothing is waited for that a person has to do.
    fn interrupt(&self) {}

    /// The ids of episodes that their participants wanted deleted, and that are deleted now.
    fn deleted(&self) -> Result<BTreeSet<String>, String> {
        Ok(BTreeSet::new())
    }

    fn ended(&self, _is_complete: bool) {}

    fn resumes(&self) {}

    #[cfg(feature = "sim")]
    fn spend(&self) -> Option<vlm::limits::Spend> {
        None
    }

    /// Looks, before the first episode is begun, whether what the agents need is there; asks nobody anything.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }

    fn stopped(&self) -> Option<String> {
        None
    }

    fn abandon(&self) {}
}
