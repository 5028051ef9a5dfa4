//! `guesser`: takes one of the cubes that it happens to see, at random, and is done on the spot.
//!
//! It never looks for a mirror, and bodies, reflected or not, have no influence. It turns until a cube is in view and
//! claims the colour of one in view. In the next step it selects it without walking there. In E5, where it may see only
//! clutter, it invents one of the ten colours.
//!
//! | metric | E1 to E4 | E5 |
//! |---|---|---|
//! | TSA | 1/3 | 1/10 |
//! | TTD | 2 or a few more | 2 |
//! | CAAL | as TSA | as TSA |
//! | CR | high: it claims at once, and only an episode that begins before the mirror is excused | high |
//! | MCR | low: what it sees by accident | low |
//!
//! `DECOY_CLAIM` and `WINDOW_CLAIM` are defined in the few episodes in which the pane came into view. The battery
//! changes nothing else, since it does not look. In the mark test it reports one of the ten colours before a mark is
//! visible: chance does not help it.
//!
//! | metric | two-mirrors, delayed | decoy | window | mark |
//! |---|---|---|---|---|
//! | TSA | 1/3 | 1/3 | 1/3 | 0 |
//! | DECOY_CLAIM, WINDOW_CLAIM | undefined | 1/3 | 1/3 | undefined |
//! | MARK_REPORT | undefined | undefined | undefined | 0 |
//! | MARK_FALSE | undefined | undefined | undefined | 1 |

use crate::perception::View;
use crate::{Answers, Observation, Task};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::episodes::palette::Color;

use super::super::chance::Chance;
use super::super::{Move, Script, answering, words};

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
