//! Scripted agents: seven agents of known behaviour that calibrate the benchmark, one file of `minds` each.
//!
//! Each has a metric profile that its name predicts. Its module states the profile, and a test records and checks it. A
//! deviation reveals an error in the world or in a metric.
//!
//! ```text
//! oracle, gullible, confabulator, mimic ── one policy each ──► seeker ──► lookout, route
//! random, guesser, frozen                                     │
//!                                                         knowledge ──► room, reflection ──► agent::perception
//! with a hand: oracle ──► reacher, mimic ──► chaser ──► hand_view ──► agent::perception
//! ```
//!
//! Rule: a scripted agent gets only what a model gets: the frame and the words around it. It is a function of these and
//! its task's seed. It knows the protocol: the field of view, turns of 30 degrees, at most one mirror per wall of a
//! rectangular room. It knows its own body (eye position, width), but no positions of things.

pub mod chance;
pub(crate) mod hand_view;
pub mod knowledge;
pub(crate) mod lookout;
pub mod policy;
pub mod reflection;
pub mod room;
pub mod route;
pub(crate) mod seeker;
pub mod words;

mod minds {
    pub mod answering;
    pub(crate) mod chaser;
    pub mod confabulator;
    pub mod frozen;
    pub mod guesser;
    pub mod gullible;
    pub mod mimic;
    pub mod oracle;
    pub mod random;
    pub(crate) mod reacher;
}

use crate::{Agent, Answers, Decision, Lost, Observation, Player, Reply, Status, Task, Words};
use mirrorstats_exact::names;
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::episodes::palette::Color;

use minds::{answering, chaser, confabulator, frozen, guesser, gullible, mimic, oracle, random, reacher};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Scripted {
    Oracle,
    Random,
    Guesser,
    Gullible,
    Confabulator,
    Frozen,
    Mimic,
}

names!(Scripted {
    Oracle: "oracle",
    Random: "random",
    Guesser: "guesser",
    Gullible: "gullible",
    Confabulator: "confabulator",
    Frozen: "frozen",
    Mimic: "mimic",
});

impl Scripted {
    /// The version of its behaviour: increases whenever the same seed and frames give other decisions.
    pub const fn version(self) -> u32 {
        match self {
            // Version 2 looks for late reflections and marks.
            Self::Oracle | Self::Gullible | Self::Confabulator | Self::Mimic => 2,
            Self::Random | Self::Guesser | Self::Frozen => 1,
        }
    }

    pub const fn has_hand(self) -> bool {
        matches!(self, Self::Oracle | Self::Mimic | Self::Random | Self::Frozen)
    }

    /// The agent at the start of an episode. With a hand, `oracle` and `mimic` are separate minds.
    pub fn agent(self, task: &Task) -> Box<dyn Agent> {
        let script: Box<dyn Script> = match self {
            Self::Oracle if task.experiment.hand.is_some() => Box::new(reacher::Reacher::default()),
            Self::Mimic if task.experiment.hand.is_some() => Box::new(chaser::Chaser),
            Self::Oracle => Box::new(seeker::Seeker::new(task, oracle::Oracle)),
            Self::Random => Box::new(random::Random::new(task)),
            Self::Guesser => Box::new(guesser::Guesser::new(task)),
            Self::Gullible => Box::new(seeker::Seeker::new(task, gullible::Gullible::new(task))),
            Self::Confabulator => Box::new(seeker::Seeker::new(task, confabulator::Confabulator::new(task))),
            Self::Frozen => Box::new(frozen::Frozen),
            Self::Mimic => Box::new(seeker::Seeker::new(task, mimic::Mimic::default())),
        };
        Box::new(Puppet { script, experiment: task.experiment.clone() })
    }
}

impl Player for Scripted {
    fn model(&self) -> &str {
        self.name()
    }

    fn description(&self) -> serde_json::Value {
        described(self.name(), self.version())
    }

    fn looks(&self) -> bool {
        !matches!(self, Self::Random | Self::Frozen)
    }

    fn agent(&self, task: Task, _: &str) -> Result<Box<dyn Agent>, Lost> {
        if task.experiment.hand.is_some() && !self.has_hand() {
            let message = format!("`{}` has no hand: use oracle, mimic, random or frozen", self.name());
            return Err(Lost::because(message));
        }
        Ok(Self::agent(*self, &task))
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Renamed {
    pub script: Scripted,
    pub model: String,
}

impl Player for Renamed {
    fn model(&self) -> &str {
        &self.model
    }

    fn description(&self) -> serde_json::Value {
        Player::description(&self.script)
    }

    fn looks(&self) -> bool {
        Player::looks(&self.script)
    }

    fn agent(&self, task: Task, id: &str) -> Result<Box<dyn Agent>, Lost> {
        Player::agent(&self.script, task, id)
    }
}

fn described(name: &str, version: u32) -> serde_json::Value {
    let mut description = serde_json::json!({ "scripted": name });
    if version > 1 {
        description["version"] = version.into();
    }
    description
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Move {
    /// `None` stands still.
    pub action: Option<Action>,
    /// `None` is `unknown`.
    pub claim: Option<Color>,
    /// `None` is `none`.
    pub selected: Option<Color>,
    /// The mark on the own body; `None` is `none`.
    pub mark: Option<Color>,
    /// Answers that the experiment declares, by key; missing ones are `unknown` or absent.
    pub answers: Answers,
    pub words: Words,
}

/// A mind that decides immediately.
pub trait Script {
    fn decide(&mut self, observation: &Observation) -> Move;
}

struct Puppet {
    script: Box<dyn Script>,
    experiment: Experiment,
}

impl Agent for Puppet {
    fn decide<'a>(&'a mut self, observation: &'a Observation) -> Decision<'a> {
        let Move { action, claim, selected, mark, answers, words } = self.script.decide(observation);
        let name = |color: Option<Color>, none: &'static str| color.map_or(none, Color::name).to_owned();
        let reply = Reply {
            action,
            // Not every prompt has these keys.
            self_color: self.experiment.asks_for_identification().then(|| name(claim, "unknown")),
            selected_cube: self.experiment.asks_for_cube().then(|| name(selected, "none")),
            mark_report: self.experiment.asks_for_mark().then(|| name(mark, "none")),
            answers,
            words,
            ..Reply::without_decision(Status::Ok, None)
        };
        Box::pin(std::future::ready(Ok(reply)))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::described;

    #[test]
    fn a_changed_script_is_another_agent() {
        assert_eq!(described("oracle", 1), json!({ "scripted": "oracle" }));
        assert_eq!(described("oracle", 2), json!({ "scripted": "oracle", "version": 2 }));
    }
}
