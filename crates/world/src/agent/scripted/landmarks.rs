//! The positions of the cubes, as far as they have been seen.
//!
//! Rule: a cube is what was seen twice at one place inside the room, or once from near by; the nearest sightings say where
//! it is. What seems to stand outside is a reflection and no cube.

use crate::agent::perception::camera::Place;
use crate::agent::perception::things::Thing;
use trace::palette::Color;

use super::room::Room;

/// A cube and how it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    pub color: Color,
    pub place: Place,
    /// From how near it was seen, m.
    pub nearest: f64,
    /// The number of sightings.
    pub sightings: u32,
}

/// Sightings of one colour this near to one another are one cube, m.
const SAME: f64 = 0.7;
/// From how near a single sighting is enough, m.
const NEAR: f64 = 3.5;
/// The distance from the walls to the middle of a cube, m.
const INSIDE: f64 = 0.15;

/// The cubes seen so far.
#[derive(Clone, Debug, Default)]
pub struct Landmarks {
    seen: Vec<Landmark>,
}

impl Landmarks {
    /// Takes in the cubes of a view from `eye`.
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
