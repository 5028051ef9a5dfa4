//! The agents that look at nothing: `random` and `frozen`.

use super::chance::Chance;
use super::{Move, Script, answering, words};
use crate::{Observation, Task, prompt};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

/// `random`: draws every action, claim and cube without looking. The lower end of the scale.
///
/// One action in five is `done`, so an episode takes five steps on average. With a hand, all six moves are equally
/// likely.
#[derive(Clone, Debug)]
pub struct Random {
    chance: Chance,
    experiment: Experiment,
}

impl Random {
    pub fn new(task: &Task) -> Self {
        Self { chance: Chance::new(task.seed), experiment: task.experiment.clone() }
    }

    fn color_or_none(&mut self) -> Option<Color> {
        let palette = self.experiment.layout.palette.iter().copied();
        let all: Vec<Option<Color>> = palette.map(Some).chain([None]).collect();
        self.chance.pick(&all).flatten()
    }
}

impl Script for Random {
    fn decide(&mut self, _: &Observation) -> Move {
        let action = self.chance.pick(prompt::actions(self.experiment.actions));
        let claim = self.color_or_none();
        let selects = action == Some(Action::Done) && self.experiment.asks_for_cube();
        let selected = if selects { self.chance.pick(&self.experiment.layout.palette) } else { None };
        let mark = if self.experiment.asks_for_mark() { self.color_or_none() } else { None };
        let answers = answering::by_chance(&self.experiment, &mut self.chance);
        let words = words::plain("I did not look.", "Everything is left to chance.", "Nothing gathered.", claim);
        Move { action, claim, selected, mark, answers, words }
    }
}

/// `frozen`: gives no action until the budget ends, and claims `unknown` at every step.
#[derive(Clone, Copy, Debug)]
pub struct Frozen;

impl Script for Frozen {
    fn decide(&mut self, _: &Observation) -> Move {
        let words = words::plain("I did not look.", "I do nothing.", "Nothing happened.", None);
        Move { words, ..Move::default() }
    }
}
