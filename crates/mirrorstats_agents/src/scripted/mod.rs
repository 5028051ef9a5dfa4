//! Scripted agents: seven agents of known behaviour that calibrate the benchmark.
//!
//! Each has a metric profile that its name predicts (`reports/world/predictions.md`), and a test records and checks it.
//! A deviation reveals an error in the world or in a metric.
//!
//! ```text
//! oracle, gullible, confabulator, mimic (policy) ──► seeker ──► lookout, route
//!                                                      │
//! guesser; random, frozen (sightless)               knowledge ──► room, reflection ──► perception
//! with a hand: oracle, mimic (reacher) ──► hand_view ──► perception
//! ```
//!
//! Rule: a scripted agent gets only what a model gets: the frame and the words around it. It is a function of these and
//! its task's seed. It knows the protocol: the field of view, turns of 30 degrees, at most one mirror per wall of a
//! rectangular room. It knows its own body (eye position, width), but no positions of things.

pub mod answering;
pub mod chance;
mod guesser;
pub(crate) mod hand_view;
pub mod knowledge;
pub(crate) mod lookout;
pub mod policy;
mod reacher;
pub mod reflection;
pub mod room;
pub mod route;
pub(crate) mod seeker;
mod sightless;
pub mod words;

use crate::{Agent, Answers, Decision, Lost, Observation, Player, Reply, Task, Words};
use mirrorstats_exact::names;
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use guesser::Guesser;
use policy::{Confabulator, Gullible, Mimic, Oracle};
use reacher::{Chaser, Reacher};
use seeker::Seeker;
use sightless::{Frozen, Random};

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
    pub const fn has_hand(self) -> bool {
        matches!(self, Self::Oracle | Self::Mimic | Self::Random | Self::Frozen)
    }

    /// The agent at the start of an episode. With a hand, `oracle` and `mimic` have separate scripts.
    pub fn agent(self, task: &Task) -> Box<dyn Agent> {
        let script: Box<dyn Script> = match self {
            Self::Oracle if task.experiment.hand.is_some() => Box::new(Reacher::default()),
            Self::Mimic if task.experiment.hand.is_some() => Box::new(Chaser),
            Self::Oracle => Box::new(Seeker::new(task, Oracle)),
            Self::Random => Box::new(Random::new(task)),
            Self::Guesser => Box::new(Guesser::new(task)),
            Self::Gullible => Box::new(Seeker::new(task, Gullible::new(task))),
            Self::Confabulator => Box::new(Seeker::new(task, Confabulator::new(task))),
            Self::Frozen => Box::new(Frozen),
            Self::Mimic => Box::new(Seeker::new(task, Mimic::default())),
        };
        Box::new(Puppet { script, experiment: task.experiment.clone() })
    }
}

/// A scripted agent under its own name or another one.
pub struct ScriptedPlayer {
    pub script: Scripted,
    pub model: String,
}

impl Player for ScriptedPlayer {
    fn model(&self) -> &str {
        &self.model
    }

    fn description(&self) -> serde_json::Value {
        let mut description = serde_json::json!({ "scripted": self.script.name() });
        // The version increases whenever the same seed and frames give other decisions: these four learned to look for
        // late reflections and marks.
        if matches!(self.script, Scripted::Oracle | Scripted::Gullible | Scripted::Confabulator | Scripted::Mimic) {
            description["version"] = 2.into();
        }
        description
    }

    fn looks(&self) -> bool {
        !matches!(self.script, Scripted::Random | Scripted::Frozen)
    }

    fn agent(&self, task: Task, _: &str) -> Result<Box<dyn Agent>, Lost> {
        Ok(self.script.agent(&task))
    }
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
            ..Reply::default()
        };
        Box::pin(std::future::ready(Ok(reply)))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{Player, Scripted, ScriptedPlayer};

    #[test]
    fn a_changed_script_is_another_agent() {
        let description = |script: Scripted| ScriptedPlayer { script, model: String::new() }.description();
        assert_eq!(description(Scripted::Random), json!({ "scripted": "random" }));
        assert_eq!(description(Scripted::Oracle), json!({ "scripted": "oracle", "version": 2 }));
    }
}
