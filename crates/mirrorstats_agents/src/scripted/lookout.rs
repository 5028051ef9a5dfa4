//! Looking around, here and then from other places.
//!
//! A full look takes eight turns if a view is more than four headings wide, as the study's is, and more if it is
//! narrower. After looking from all lookouts an agent has seen everything.
//!
//! Rule: the first lookout is the starting place; the others are spread over the known part of the room.

use crate::perception::camera::{Heading, Place, Viewpoint};
use mirrorstats_experiment::angle::HEADINGS;
use mirrorstats_trace::episodes::episode::Action;

use super::knowledge::Knowledge;
use super::room::WallSide;

const LOOKOUTS: usize = 3;
/// The distance within which a lookout counts as reached, m.
const ARRIVED: f64 = 0.5;
/// Steps after which an unreachable lookout is replaced by the current place.
const PATIENCE: u32 = 16;

#[derive(Clone, Debug, Default)]
pub(crate) struct Lookouts {
    done: Vec<Place>,
    /// The next lookout; `None` if it is the current place.
    goal: Option<Place>,
    seen: Vec<Heading>,
    here: Option<Place>,
    walked: u32,
}

impl Lookouts {
    /// The next action; `None` once there is nothing more to see.
    pub fn action(&mut self, known: &Knowledge) -> Option<Action> {
        while !self.are_over() {
            let action = match self.goal {
                Some(goal) => self.walk(known, goal),
                None => self.turn(known),
            };
            if action.is_some() {
                return action;
            }
            if self.goal.take().is_none() {
                self.finish(known);
            }
        }
        None
    }

    pub(crate) fn are_over(&self) -> bool {
        self.done.len() >= LOOKOUTS
    }

    fn walk(&mut self, known: &Knowledge, goal: Place) -> Option<Action> {
        self.walked += 1;
        if self.walked > PATIENCE {
            return None;
        }
        let arrived = |pose: Viewpoint| pose.place.distance(goal) < ARRIVED;
        known.way(&known.obstacles(), &arrived, &|place| place.distance(goal) - ARRIVED)
    }

    /// One more turn, unless all directions have been seen from here.
    fn turn(&mut self, known: &Knowledge) -> Option<Action> {
        let pose = known.pose;
        if self.here.is_none_or(|here| here.distance(pose.place) > ARRIVED) {
            self.here = Some(pose.place);
            self.seen.clear();
        }
        self.seen.push(pose.heading);
        let is_seen =
            |heading: Heading| self.seen.iter().any(|seen| seen.turns_to(heading).abs() <= known.headings_aside);
        (!(0..HEADINGS).map(Heading::new).all(is_seen)).then_some(Action::TurnLeft)
    }

    fn finish(&mut self, known: &Knowledge) {
        self.done.push(known.pose.place);
        self.here = None;
        self.walked = 0;
        self.goal = candidates(known).into_iter().max_by(|one, other| self.away(*one).total_cmp(&self.away(*other)));
    }

    fn away(&self, place: Place) -> f64 {
        self.done.iter().map(|done| done.distance(place)).fold(f64::INFINITY, f64::min)
    }
}

fn candidates(known: &Knowledge) -> Vec<Place> {
    let edge = |side: WallSide| known.room.wall(side).unwrap_or_else(|| side.out(known.pose.place) + 2.0);
    let (east, north, west, south) =
        (edge(WallSide::East), edge(WallSide::North), -edge(WallSide::West), -edge(WallSide::South));
    let at = |part_x: f64, part_y: f64| Place { x: west + part_x * (east - west), y: south + part_y * (north - south) };
    let places = [at(0.25, 0.25), at(0.75, 0.25), at(0.25, 0.75), at(0.75, 0.75), at(0.5, 0.5)];
    let obstacles = known.obstacles();
    let is_free = |place: &Place| obstacles.iter().all(|obstacle| obstacle.place.distance(*place) > obstacle.radius);
    places.into_iter().filter(is_free).collect()
}
