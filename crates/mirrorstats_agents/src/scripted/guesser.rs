//! `guesser`: takes one of the cubes that it happens to see, at random, and is done on the spot.
//!
//! It never looks for a mirror, and bodies, reflected or not, have no influence. It turns until a cube is in view and
//! claims the colour of one in view. In the next step it selects it without walking there. Without cubes to select it
//! invents a colour.

use crate::perception::View;
use crate::{Answers, Observation, Task};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use super::chance::Chance;
use super::{Move, Script, answering, words};

/// Turns after which it has seen all directions.
const ROUND: i32 = 12;

#[derive(Clone, Debug)]
pub struct Guesser {
    chance: Chance,
    experiment: Experiment,
    guess: Option<Color>,
    answers: Answers,
}

impl Guesser {
    pub fn new(task: &Task) -> Self {
        Self {
            chance: Chance::new(task.seed),
            experiment: task.experiment.clone(),
            guess: None,
            answers: Answers::new(),
        }
    }

    fn pick(&mut self, observation: &Observation) -> Option<Color> {
        let mut colors: Vec<Color> = if self.experiment.asks_for_cube() {
            View::from_observation(observation).cubes.iter().map(|cube| cube.color).collect()
        } else {
            self.experiment.layout.palette.clone()
        };
        colors.sort();
        colors.dedup();
        let seen = self.chance.pick(&colors);
        seen.or_else(|| (observation.t > ROUND).then(|| self.chance.pick(&self.experiment.layout.palette)).flatten())
    }
}

impl Script for Guesser {
    fn decide(&mut self, observation: &Observation) -> Move {
        let was_set = self.guess.is_some();
        if !was_set {
            self.guess = self.pick(observation);
            self.answers = answering::by_chance(&self.experiment, &mut self.chance);
        }
        let action = if was_set || observation.remaining <= 1 { Action::Done } else { Action::TurnLeft };
        let is_choice = action == Action::Done && self.experiment.asks_for_cube();
        let (view, summary) = match self.guess {
            Some(_) => ("Something to choose from.", "I have chosen."),
            None => ("Nothing to choose from.", "I have not chosen."),
        };
        let words = words::plain(view, "One is as good as another; I do not look for more.", summary, self.guess);
        // A mark is as good a guess as any colour.
        Move {
            action: Some(action),
            claim: self.guess,
            selected: self.guess.filter(|_| is_choice),
            mark: self.guess,
            answers: self.answers.clone(),
            words,
        }
    }
}
