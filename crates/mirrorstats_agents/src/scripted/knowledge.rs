//! The knowledge of an agent within an episode: its pose, the room, the cubes, its reflection, and obstacles.
//!
//! A cube was seen twice at one place inside the room, or once from nearby; the nearest sightings determine its place. An
//! apparent cube outside the room is a reflection.
//!
//! Rule: knowledge only absorbs views; it decides nothing.

use crate::Observation;
use crate::perception::View;
use crate::perception::camera::{Place, Viewpoint};
use crate::perception::things::Thing;
use mirrorstats_trace::episodes::episode::Action;
use mirrorstats_trace::schema::colors::Color;

use super::reflection::{self, Reflection};
use super::room::{Room, WallSide};
use super::route::{self, Ground, Obstacle};

/// The assumed length of a step before the first one, m.
const STEP: f64 = 0.4;
/// The distance that a body's axis keeps from a wall, m.
const GIRTH: f64 = 0.42;
/// The distance that a body's axis keeps from the middle of a cube, m.
const AROUND_CUBE: f64 = 0.73;
/// The distance that it keeps from the axis of another body, m.
const AROUND_BODY: f64 = 0.9;
/// The distance within which other bodies are avoided, m.
const NEAR_BODY: f64 = 2.5;
/// The maximum distance of a mirrored body from the own reflection's place to count as there, m.
const NEAR_OWN: f64 = 0.7;
/// Steps for which a body is assumed to be where it was seen.
const MEMORY_OF_BODY: i32 = 2;
/// The assumed cause of a bump: its distance ahead, its width, and its duration in steps.
const BUMP: (f64, f64, i32) = (0.7, 0.55, 6);

/// The distance within which sightings of one colour are one cube, m.
const SAME_CUBE: f64 = 0.7;
/// The distance within which a single sighting suffices, m.
const NEAR_CUBE: f64 = 3.5;
/// The minimum distance of a cube's middle from the walls, m.
const INSIDE: f64 = 0.15;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    pub color: Color,
    pub place: Place,
    /// The distance of its nearest sighting, m.
    pub nearest: f64,
    pub sightings: u32,
}

#[derive(Clone, Debug, Default)]
pub struct Knowledge {
    pub pose: Viewpoint,
    pub room: Room,
    pub reflection: Reflection,
    /// The bodies in view, including reflections.
    pub bodies: Vec<Thing>,
    /// Bodies in view with a patch of another colour: the body's colour and the patch's.
    pub patched: Vec<(Color, Color)>,
    /// The cubes in view, including reflections.
    pub(crate) cubes_in_view: Vec<Thing>,
    pub step: f64,
    /// Headings to either side of the own one that are in view.
    pub(crate) headings_aside: i32,
    /// All cubes that were seen, reflections included, in the order in which they were first seen.
    landmarks: Vec<Landmark>,
    passing: Vec<(Obstacle, i32)>,
}

impl Knowledge {
    pub fn new(observation: &Observation) -> Self {
        Self { pose: Viewpoint::from_observation(observation), step: STEP, ..Self::default() }
    }

    pub fn see(&mut self, observation: &Observation) {
        let view = View::from_observation(observation);
        self.feel(observation, view.pose);
        self.room.see(&view);
        self.see_cubes(&view.cubes, view.camera.eye);
        self.reflection.see(&view, &self.room);
        self.notice(&view.bodies, observation.t);
        self.headings_aside = view.camera.headings_aside();
        let patch = |body: &Thing| reflection::patch_at(&view, body.place, body.color).map(|patch| (body.color, patch));
        self.patched = view.bodies.iter().filter_map(patch).collect();
        self.bodies = view.bodies;
        self.cubes_in_view = view.cubes;
    }

    fn feel(&mut self, observation: &Observation, pose: Viewpoint) {
        let moved = pose.place.distance(self.pose.place);
        let last = observation.history.as_ref().and_then(|(action, _)| *action);
        if moved > 0.05 && last == Some(Action::MoveForward) {
            self.step = moved;
        }
        self.passing.retain(|(_, until)| *until >= observation.t);
        if observation.bumped {
            let way = if last == Some(Action::MoveBackward) { -BUMP.0 } else { BUMP.0 };
            let obstacle = Obstacle { place: pose.place.ahead(pose.heading, way), radius: BUMP.1 };
            self.passing.push((obstacle, observation.t + BUMP.2));
        }
        self.pose = pose;
    }

    pub(crate) fn in_mirrors(&self) -> Vec<Thing> {
        let crossed = |body: &Thing| self.room.crossing(self.pose.place, body.place).map(|(side, _)| side);
        let is_through =
            |body: &&Thing| crossed(body).is_some_and(|side| self.room.mirrors().any(|mirror| mirror == side));
        self.bodies.iter().filter(is_through).copied().collect()
    }

    /// The number of bodies to the left of the own one in the mirror. `None` unless exactly `count` bodies are in it,
    /// the own one among them.
    pub fn mirror_place(&self, count: usize) -> Option<usize> {
        let own = self.reflection.own_place(&self.room)?;
        let through = self.in_mirrors();
        let away = |body: &Thing| body.place.distance(own);
        let nearest = through.iter().min_by(|one, other| away(one).total_cmp(&away(other)))?;
        let is_whole = through.len() == count && away(nearest) < NEAR_OWN;
        is_whole.then(|| through.iter().filter(|body| body.column < nearest.column).count())
    }

    fn see_cubes(&mut self, cubes: &[Thing], eye: Place) {
        for &Thing { color, place, .. } in cubes {
            let nearest = eye.distance(place);
            let is_same = |known: &&mut Landmark| known.color == color && known.place.distance(place) < SAME_CUBE;
            let known = self.landmarks.iter_mut().find(is_same);
            match known {
                None => self.landmarks.push(Landmark { color, place, nearest, sightings: 1 }),
                Some(known) => {
                    known.sightings += 1;
                    if nearest <= known.nearest {
                        (known.place, known.nearest) = (place, nearest);
                    }
                }
            }
        }
    }

    /// The cubes in the room, in the order in which they were first seen.
    pub fn cubes(&self) -> Vec<Landmark> {
        let is_certain = |cube: &&Landmark| cube.sightings >= 2 || cube.nearest < NEAR_CUBE;
        let is_inside = |cube: &&Landmark| self.room.holds(cube.place, INSIDE);
        self.landmarks.iter().filter(is_certain).filter(is_inside).copied().collect()
    }

    pub fn cube(&self, color: Color) -> Option<Landmark> {
        let of_color = self.cubes().into_iter().filter(|cube| cube.color == color);
        of_color.min_by(|one, other| one.nearest.total_cmp(&other.nearest))
    }

    fn notice(&mut self, bodies: &[Thing], t: i32) {
        let cubes = self.cubes();
        let is_cube =
            |body: &Thing| cubes.iter().any(|cube| cube.color == body.color && cube.place.distance(body.place) < 1.0);
        let is_near =
            |body: &Thing| body.place.distance(self.pose.place) < NEAR_BODY && self.room.holds(body.place, 0.0);
        let near = bodies.iter().filter(|body| is_near(body) && !is_cube(body));
        let obstacles: Vec<_> =
            near.map(|body| (Obstacle { place: body.place, radius: AROUND_BODY }, t + MEMORY_OF_BODY)).collect();
        self.passing.extend(obstacles);
    }

    pub fn obstacles(&self) -> Vec<Obstacle> {
        self.standing().into_iter().chain(self.passing.iter().map(|(obstacle, _)| *obstacle)).collect()
    }

    pub fn standing(&self) -> Vec<Obstacle> {
        self.cubes().into_iter().map(|cube| Obstacle { place: cube.place, radius: AROUND_CUBE }).collect()
    }

    /// The first action on the way to a pose that `is_goal`; `far` is a lower bound of the metres to it.
    pub(crate) fn way(
        &self,
        obstacles: &[Obstacle],
        is_goal: &dyn Fn(Viewpoint) -> bool,
        far: &dyn Fn(Place) -> f64,
    ) -> Option<Action> {
        let ground = Ground { is_open: &|place| self.room.holds(place, GIRTH), obstacles, step: self.step };
        route::first_action(self.pose, &ground, is_goal, far)
    }

    /// The sides whose wall is a mirror right across from a place.
    pub(crate) fn mirrors_across(&self, place: Place) -> impl Iterator<Item = WallSide> + '_ {
        let is_mirror = move |side: &WallSide| self.room.is_mirror(*side, side.along(place));
        WallSide::ALL.into_iter().filter(is_mirror)
    }
}
