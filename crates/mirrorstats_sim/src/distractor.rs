//! Another agent: walks about, turns away from walls and cubes, and lets bodies pass.
//!
//! Rule: it reacts only to its habit and to obstacles, never to a clock; it never passes through anything.

use super::body::Figure;
use super::config::OthersConfig;
use super::floor::FloorPlan;
use super::rng::Rng;
use super::scene::Other;

#[derive(Clone, Debug)]
pub(crate) struct Distractor {
    pub figure: Figure,
    chance: Rng,
    /// Turns to make before it walks on; negative to the right.
    turns: i8,
    strides: u32,
    waited: u32,
}

impl Distractor {
    pub fn new(other: &Other) -> Self {
        let mut chance = Rng::from_number(u64::from(other.habit));
        let strides = 2 + chance.below(6);
        Self { figure: Figure::standing(other.start), chance, turns: 0, strides, waited: 0 }
    }

    /// One tick: a step, a turn of 30 degrees, or a moment's wait.
    pub fn tick(&mut self, config: &OthersConfig, plan: &FloorPlan, bodies: &[[f64; 2]]) {
        if self.turns != 0 {
            self.figure.turn(self.turns.signum());
            self.turns -= self.turns.signum();
            return;
        }
        let from = self.figure.pose;
        let to = from.ahead(config.step_length);
        let is_clear = plan.is_passable(from.spot(), to.spot());
        if self.strides == 0 || !is_clear {
            self.turn_away();
        } else if bodies.iter().any(|body| plan.is_blocked_by(from.spot(), to.spot(), *body)) {
            self.wait(config);
        } else {
            self.waited = 0;
            self.strides -= 1;
            self.figure.step_to(to);
        }
    }

    fn wait(&mut self, config: &OthersConfig) {
        self.waited += 1;
        if self.waited > config.patience {
            self.turn_away();
        } else {
            self.figure.stand();
        }
    }

    fn turn_away(&mut self) {
        self.waited = 0;
        self.strides = 3 + self.chance.below(10);
        let thirties = self.chance.one_of(&[1_i8, 2, 2, 3, 3, 4, 5]);
        let signed = if self.chance.happens(50) { thirties } else { -thirties };
        self.figure.turn(signed.signum());
        self.turns = signed - signed.signum();
    }
}
