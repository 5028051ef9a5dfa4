//! The known positions of the cubes.
//!
//! Rule: a cube was seen twice at one place inside the room, or once from nearby; the nearest sightings determine its
//! place. An apparent cube outside the room is a reflection.

use crate::agent::perception::camera::Place;
use crate::agent::perception::things::Thing;
use trace::palette::Color;

use super::room::Room;

/// A cube and the quality of its sightings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    pub color: Color,
    pub place: Place,
    /// The distance of its nearest sighting, m.
    pub nearest: f64,
    pub sightings: u32,
}

/// The distance within which sightings of one colour are one cube, m.
const SAME: f64 = 0.7;
/// The distance within which a single sighting suffices, m.
const NEAR: f64 = 3.5;
/// The minimum distance of a cube's middle from the walls, m.
const INSIDE: f64 = 0.15;

#[derive(Clone, Debug, Default)]
pub struct Landmarks {
    seen: Vec<Landmark>,
}

impl Landmarks {
    /// Adds the cubes of a view from `eye`.
    pub fn see(&mut self, cubes: &[Thing], eye: Place) {
        for cube in cubes {
            let away = eye.distance(cube.place);
            let known =
                self.seen.iter_mut().find(|known| known.color == cube.color && known.place.distance(cube.place) < SAME);
            match known {
                None => {
                    let (color, place) = (cube.color, cube.place);
                    self.seen.push(Landmark { color, place, nearest: away, sightings: 1 });
                }
                Some(known) => {
                    known.sightings += 1;
                    if away <= known.nearest {
                        (known.place, known.nearest) = (cube.place, away);
                    }
                }
            }
        }
    }

    /// The cubes in the room, in the order in which they were first seen.
    pub fn cubes(&self, room: &Room) -> Vec<Landmark> {
        let certain = |cube: &&Landmark| cube.sightings >= 2 || cube.nearest < NEAR;
        self.seen.iter().filter(certain).filter(|cube| room.holds(cube.place, INSIDE)).copied().collect()
    }
}
