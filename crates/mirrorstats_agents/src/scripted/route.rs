//! The route to a goal: the first action of the cheapest sequence of steps and turns.
//!
//! The search is A* over poses reachable by whole steps and turns of 30 degrees. Poses with equal heading in one small
//! cell count as one, so the search is finite and fast, and its result can be walked exactly.
//!
//! Rule: the fixed order of the search settles equal costs.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use crate::perception::camera::{Heading, Place, Viewpoint};
use mirrorstats_trace::episodes::episode::Action;

/// An obstacle: a circle that the body's axis avoids.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    pub place: Place,
    /// m.
    pub radius: f64,
}

pub struct Ground<'a> {
    pub is_open: &'a dyn Fn(Place) -> bool,
    pub obstacles: &'a [Obstacle],
    pub step: f64,
}

/// Edge of the cells, m.
const CELL: f64 = 0.2;
/// Costs of a step forward, of a turn, and of a step backward, which is blind.
const FORWARD: u32 = 10;
const TURN: u32 = 9;
const BACKWARD: u32 = 16;
/// The number of examined poses after which the goal counts as unreachable.
const PATIENCE: usize = 6_000;

/// The first action on the way from `start` to a pose that `is_goal`; `None` if there is no way or no need for one.
///
/// `far` is a lower bound of the metres from a place to the goal; zero is always valid, but slow.
pub(crate) fn first_action(
    start: Viewpoint,
    ground: &Ground<'_>,
    is_goal: &dyn Fn(Viewpoint) -> bool,
    far: &dyn Fn(Place) -> f64,
) -> Option<Action> {
    let mut search = Search { open: BinaryHeap::new(), nodes: Vec::new(), closed: BTreeSet::new() };
    search.push(Node { pose: start, cost: 0, first: None }, bound(far(start.place), ground.step));
    while let Some(Reverse((_, at))) = search.open.pop() {
        let node = search.nodes[at];
        if is_goal(node.pose) {
            return node.first;
        }
        if search.closed.len() >= PATIENCE || !search.closed.insert(key(node.pose)) {
            continue;
        }
        for (action, price) in [
            (Action::MoveForward, FORWARD),
            (Action::TurnLeft, TURN),
            (Action::TurnRight, TURN),
            (Action::MoveBackward, BACKWARD),
        ] {
            let pose = after(node.pose, action, ground.step);
            if pose.place == node.pose.place || is_free(ground, node.pose.place, pose.place) {
                let first = node.first.or(Some(action));
                search.push(Node { pose, cost: node.cost + price, first }, bound(far(pose.place), ground.step));
            }
        }
    }
    None
}

#[derive(Clone, Copy)]
struct Node {
    pose: Viewpoint,
    cost: u32,
    first: Option<Action>,
}

struct Search {
    /// Estimated total cost and the node's index, which settles ties.
    open: BinaryHeap<Reverse<(u32, usize)>>,
    nodes: Vec<Node>,
    closed: BTreeSet<(i32, i32, Heading)>,
}

impl Search {
    fn push(&mut self, node: Node, bound: u32) {
        if !self.closed.contains(&key(node.pose)) {
            self.open.push(Reverse((node.cost + bound, self.nodes.len())));
            self.nodes.push(node);
        }
    }
}

pub fn after(pose: Viewpoint, action: Action, step: f64) -> Viewpoint {
    match action {
        Action::MoveForward => Viewpoint { place: pose.place.ahead(pose.heading, step), ..pose },
        Action::MoveBackward => Viewpoint { place: pose.place.ahead(pose.heading, -step), ..pose },
        Action::TurnLeft => Viewpoint { heading: pose.heading.turned(1), ..pose },
        Action::TurnRight => Viewpoint { heading: pose.heading.turned(-1), ..pose },
        // A hand moves no body.
        _ => pose,
    }
}

/// Returns true if a step may end at `to`. An agent already too near to something may move away from it.
fn is_free(ground: &Ground<'_>, from: Place, to: Place) -> bool {
    let clear = |obstacle: &Obstacle| {
        let (before, behind) = (obstacle.place.distance(from), obstacle.place.distance(to));
        behind >= obstacle.radius || behind > before
    };
    (ground.is_open)(to) && ground.obstacles.iter().all(clear)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rooms are small")]
fn bound(metres: f64, step: f64) -> u32 {
    (metres.max(0.0) / step * f64::from(FORWARD)) as u32
}

#[expect(clippy::cast_possible_truncation, reason = "rooms are small")]
fn key(pose: Viewpoint) -> (i32, i32, Heading) {
    let cell = |metres: f64| (metres / CELL).round() as i32;
    (cell(pose.place.x), cell(pose.place.y), pose.heading)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 0.4;

    /// Walks from the origin, facing +x, to within half a metre of `goal`; the places on the way.
    fn walk(goal: Place, obstacles: &[Obstacle]) -> Vec<Place> {
        let is_open = |place: Place| place.x.abs() < 4.0 && place.y.abs() < 4.0;
        let ground = Ground { is_open: &is_open, obstacles, step: STEP };
        let mut pose = Viewpoint { place: Place { x: 0.0, y: 0.0 }, heading: Heading::nearest(0.0) };
        let mut places = vec![pose.place];
        let far = |place: Place| place.distance(goal) - 0.5;
        while let Some(action) = first_action(pose, &ground, &|pose| pose.place.distance(goal) < 0.5, &far) {
            pose = after(pose, action, STEP);
            places.push(pose.place);
            assert!(places.len() < 60, "walks in circles");
        }
        places
    }

    #[test]
    fn straight_on_takes_the_fewest_steps() {
        let places = walk(Place { x: 2.0, y: 0.0 }, &[]);
        assert_eq!(places.len(), 5);
        assert!((places[4].x - 1.6).abs() < 1e-9);
    }

    #[test]
    fn the_route_leads_around_an_obstacle() {
        let obstacle = Obstacle { place: Place { x: 1.2, y: 0.0 }, radius: 0.8 };
        let goal = Place { x: 3.0, y: 0.0 };
        let places = walk(goal, &[obstacle]);
        assert!(places.iter().all(|place| place.distance(obstacle.place) >= obstacle.radius));
        assert!(places.last().unwrap().distance(goal) < 0.5);
    }

    #[test]
    fn a_body_too_near_an_obstacle_may_leave() {
        let obstacle = Obstacle { place: Place { x: -0.3, y: 0.0 }, radius: 0.8 };
        assert_eq!(walk(Place { x: 2.0, y: 0.0 }, &[obstacle]).len(), 5);
    }

    #[test]
    fn a_goal_outside_the_room_has_no_route() {
        assert_eq!(walk(Place { x: 9.0, y: 0.0 }, &[]).len(), 1);
    }
}
