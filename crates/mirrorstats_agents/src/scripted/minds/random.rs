//! `random`: draws every action, claim and cube without looking. The lower end of the scale.
//!
//! One action in five is `done`, so an episode takes five steps on average. With `done` it selects one of the ten
//! colours, and claims one of the ten or `unknown`.
//!
//! | metric | everywhere |
//! |---|---|
//! | TSA | 1/10 in E1 to E4, 1/11 in E5 |
//! | TTD | 5 |
//! | CR | high: it mostly claims at once |
//! | MCR in E2 | 0 |
//!
//! | metric in the battery | |
//! |---|---|
//! | TSA | 1/10, and hardly ever in the mark test: it is done before the mark appears |
//! | `DECOY_CLAIM` | 1/10 |
//! | `WINDOW_CLAIM` | about 1/3: five claims, each of one of eleven |
//! | MCR in `window` | 0 |
//! | `MARK_REPORT` | hardly ever |
//! | `MARK_FALSE` | high: it mostly reports a colour at once |
//!
//! With a hand, all six moves are equally likely, so no arm or level makes a difference:
//!
//! | metric where a hand reaches | every arm and level alike |
//! |---|---|
//! | SUCCESS | 1/10 or less: a walk of some 19 steps rarely ends where 6 to 12 steps in one direction lead |
//! | SIR | 250,000 to 500,000: below a half, since the body stops some moves |
//! | PCR | above 0 |
//! | UNREADABLE | 0 |

use crate::{Observation, Task, prompt};
use mirrorstats_experiment::Experiment;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::episodes::palette::Color;

use super::super::chance::Chance;
use super::super::{Move, Script, answering, words};

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
