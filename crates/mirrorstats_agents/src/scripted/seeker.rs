//! An episode of an agent that looks before it chooses.
//!
//! ```text
//! look round ──► go before the mirror ──► settled on a colour ──► go to its cube ──► done
//!      └── no mirror anywhere, or the budget runs out ──► choose a cube by chance ──┘
//! ```
//!
//! Its [`Policy`] determines its belief about itself, and when the belief is settled; in everything else seekers are
//! alike. In E5 there is no cube to go to, so it is done once settled. To report a mark, or its place in the mirror, it
//! looks into the mirror until it has an answer or little budget is left.
//!
//! Rule: it selects a cube only from at most one step away, except on the last step, where waiting gains nothing.

use crate::perception::camera::{Place, Viewpoint};
use crate::{Observation, Task};
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use super::chance::Chance;
use super::knowledge::{Knowledge, Landmark};
use super::lookout::Lookouts;
use super::policy::{Belief, Policy};
use super::room::WallSide;
use super::words;
use super::{Move, Script, answering};

/// The distance from a cube's middle at which the body is at most one step away, m.
const NEAR: f64 = 1.0;
/// The remaining steps at which an unsettled agent chooses at random.
const RESERVE: i32 = 32;
/// Turns on the spot after which it ignores passers-by.
const PATIENCE: u32 = 9;
/// The remaining steps at which an agent without a mark stops looking.
const LAST_LOOKS: i32 = 10;
/// The range of distances from a mirror for a good look at oneself, m.
const BEFORE_MIRROR: (f64, f64) = (0.9, 2.8);
/// The distance between places for looking into the mirror, m.
const APART: f64 = 0.3;

pub struct Seeker<C> {
    policy: C,
    task: Task,
    known: Option<Knowledge>,
    lookouts: Lookouts,
    chance: Chance,
    looked_from: Vec<Place>,
    guess: Option<Color>,
    /// True if it had decided before this step.
    has_claimed: bool,
    /// Turns since its last change of place.
    turns: u32,
}

impl<C: Policy> Seeker<C> {
    pub fn new(task: &Task, policy: C) -> Self {
        Self {
            policy,
            task: task.clone(),
            known: None,
            lookouts: Lookouts::default(),
            chance: Chance::new(task.seed),
            looked_from: Vec::new(),
            guess: None,
            has_claimed: false,
            turns: 0,
        }
    }

    fn act(&mut self, known: &Knowledge, belief: Belief, is_open: bool, remaining: i32) -> (Action, Option<Color>) {
        if !self.task.experiment.asks_for_cube() {
            return (self.explore(known, belief, is_open && remaining > LAST_LOOKS, remaining), None);
        }
        match self.choice(known, belief, remaining) {
            choice if remaining <= 1 => (Action::Done, choice),
            None => (self.look_for_mirror(known), None),
            Some(color) => match known.cube(color) {
                None => (self.look_around(known), None),
                Some(cube) if self.has_claimed && known.pose.place.distance(cube.place) <= NEAR => {
                    (Action::Done, Some(color))
                }
                Some(cube) => (self.approach(known, cube), None),
            },
        }
    }

    fn explore(&mut self, known: &Knowledge, belief: Belief, is_open: bool, remaining: i32) -> Action {
        if remaining <= 1 || (belief.settled && self.has_claimed && !is_open) {
            Action::Done
        } else if belief.settled && is_open {
            self.watch(known)
        } else if belief.settled {
            Action::TurnLeft
        } else {
            self.look_for_mirror(known)
        }
    }

    fn choice(&mut self, known: &Knowledge, belief: Belief, remaining: i32) -> Option<Color> {
        if belief.settled {
            return belief.claim;
        }
        let hopeless = remaining <= RESERVE || (self.lookouts.are_over() && !known.room.has_mirror());
        if self.guess.is_none() && hopeless {
            let mut colors: Vec<Color> = known.cubes().iter().map(|cube| cube.color).collect();
            colors.sort();
            colors.dedup();
            let claimed = belief.claim.filter(|claim| colors.contains(claim));
            self.guess = claimed.or_else(|| self.chance.pick(&colors));
        }
        self.guess
    }

    /// Goes before the mirror, or looks around for one.
    fn look_for_mirror(&mut self, known: &Knowledge) -> Action {
        if !known.room.has_mirror() {
            return self.look_around(known);
        }
        if is_before_mirror(known, known.pose) {
            self.looked_from.push(known.pose.place);
        }
        let is_new = |place: Place| self.looked_from.iter().all(|from| from.distance(place) > APART);
        let is_goal = |pose: Viewpoint| is_new(pose.place) && is_before_mirror(known, pose);
        way_to_mirror(known, &is_goal).unwrap_or_else(|| self.look_around(known))
    }

    /// Stays before the mirror and looks into it: it turns back and forth, since no action keeps still.
    fn watch(&mut self, known: &Knowledge) -> Action {
        if !known.room.has_mirror() {
            return self.look_around(known);
        }
        match turns_to_mirror(known, known.pose) {
            Some(turns) if turns < 0 => Action::TurnRight,
            Some(_) => Action::TurnLeft,
            None => {
                let way = way_to_mirror(known, &|pose| is_before_mirror(known, pose));
                way.unwrap_or_else(|| self.look_around(known))
            }
        }
    }

    fn approach(&self, known: &Knowledge, cube: Landmark) -> Action {
        let is_goal = |pose: Viewpoint| pose.place.distance(cube.place) <= NEAR;
        let far = |place: Place| place.distance(cube.place) - NEAR;
        let careful = if self.turns > PATIENCE { None } else { known.way(&known.obstacles(), &is_goal, &far) };
        careful.or_else(|| known.way(&known.standing(), &is_goal, &far)).unwrap_or(Action::TurnLeft)
    }

    /// Looks around, and starts again when everything has been seen.
    fn look_around(&mut self, known: &Knowledge) -> Action {
        self.lookouts.action(known).unwrap_or(Action::TurnLeft)
    }
}

impl<C: Policy> Script for Seeker<C> {
    fn decide(&mut self, observation: &Observation) -> Move {
        let mut known = self.known.take().unwrap_or_else(|| Knowledge::new(observation));
        let before = known.pose.place;
        known.see(observation);
        self.turns = if known.pose.place == before { self.turns + 1 } else { 0 };
        let belief = self.policy.belief(&known);
        let experiment = &self.task.experiment;
        let mark = experiment.asks_for_mark().then(|| self.policy.mark(&known)).flatten();
        let answers = answering::by_evidence(experiment, &known, &mut self.policy, (belief, mark));
        let is_open = experiment.asks_for_mark() && mark.is_none() || answering::may_come(experiment, &answers);
        let (action, selected) = self.act(&known, belief, is_open, observation.remaining);
        self.has_claimed |= belief.settled || self.guess.is_some();
        let words = words::describe(&known, belief, action, selected);
        self.known = Some(known);
        Move { action: Some(action), claim: belief.claim, selected, mark, answers, words }
    }
}

fn is_before_mirror(known: &Knowledge, pose: Viewpoint) -> bool {
    turns_to_mirror(known, pose).is_some()
}

/// Turns to the left, -1 to 1, that make a pose at a good distance look straight into a mirror; `None` if it looks into
/// none.
fn turns_to_mirror(known: &Knowledge, pose: Viewpoint) -> Option<i32> {
    known.mirrors_across(pose.place).find_map(|side| {
        let away = known.room.wall(side).map_or(f64::INFINITY, |wall| wall - side.out(pose.place));
        let turns = pose.heading.turns_to(side.heading());
        ((BEFORE_MIRROR.0..=BEFORE_MIRROR.1).contains(&away) && turns.abs() <= 1).then_some(turns)
    })
}

/// A lower bound of the metres from a place to the nearest wall that is a mirror.
fn metres_to_mirror(known: &Knowledge, place: Place) -> f64 {
    let away = |side: WallSide| known.room.wall(side).map(|wall| wall - side.out(place));
    known.room.mirrors().filter_map(away).fold(f64::INFINITY, f64::min).min(1e3)
}

fn way_to_mirror(known: &Knowledge, is_goal: &dyn Fn(Viewpoint) -> bool) -> Option<Action> {
    let far = |place: Place| metres_to_mirror(known, place) - BEFORE_MIRROR.1;
    known.way(&known.obstacles(), is_goal, &far)
}
