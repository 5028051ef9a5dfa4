//! The known part of the room: four walls, and which parts are mirrors.
//!
//! A wall is the nearest straight line on its side with enough feet of walls. Feet that appear beyond a wall were seen
//! through it: there it is a mirror.
//!
//! Rule: walls are parallel to the room's axes. Only the set of feet seen so far matters, not their order.

use crate::perception::View;
use crate::perception::camera::{Heading, Place};
use crate::perception::ground::Foot;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum WallSide {
    East,
    North,
    West,
    South,
}

impl WallSide {
    pub const ALL: [Self; 4] = [Self::East, Self::North, Self::West, Self::South];

    /// The distance of a place in this direction, m.
    pub const fn out(self, place: Place) -> f64 {
        match self {
            Self::East => place.x,
            Self::North => place.y,
            Self::West => -place.x,
            Self::South => -place.y,
        }
    }

    /// The position of a place along a wall on this side, m.
    pub const fn along(self, place: Place) -> f64 {
        match self {
            Self::East | Self::West => place.y,
            Self::North | Self::South => place.x,
        }
    }

    /// The place that is so far out and so far along.
    pub const fn place(self, out: f64, along: f64) -> Place {
        match self {
            Self::East => Place { x: out, y: along },
            Self::North => Place { x: along, y: out },
            Self::West => Place { x: -out, y: along },
            Self::South => Place { x: along, y: -out },
        }
    }

    pub const fn heading(self) -> Heading {
        Heading::new(3 * self as u8)
    }
}

#[derive(Clone, Copy, Debug)]
struct Glance {
    from: Place,
    foot: Foot,
    side: Option<WallSide>,
}

/// The width of the pieces of wall on which looks vote, m.
const PIECE: f64 = 0.25;
/// Pieces from the middle of a wall to either end: rooms up to 16 m wide.
const PIECES: i32 = 32;
/// The maximum change of a foot's place by one row for it to fix a wall, m.
const SHARP: f64 = 0.16;
/// The number of looks that fix a wall.
const ENOUGH: usize = 10;
/// The drawn width of a wall's line, m.
const LINE: f64 = 0.12;
/// The minimum distance beyond a wall of a foot seen through it, m.
const BEYOND: f64 = 0.5;

#[derive(Clone, Debug, Default)]
pub struct Room {
    looks: Vec<Glance>,
    walls: [Option<f64>; 4],
    votes: [Vec<i32>; 4],
}

impl Room {
    pub fn see(&mut self, view: &View) {
        let from = view.camera.eye;
        let side = |at: usize| {
            side_of(view.pose.place, view.feet.get(at.wrapping_sub(1)), &view.feet[at], view.feet.get(at + 1))
        };
        self.looks.extend((0..view.feet.len()).map(|at| Glance { from, foot: view.feet[at], side: side(at) }));
        self.walls = WallSide::ALL.map(|side| self.fixed(side, view.pose.place));
        self.votes = WallSide::ALL.map(|side| self.vote(side));
    }

    pub const fn wall(&self, side: WallSide) -> Option<f64> {
        self.walls[side as usize]
    }

    /// Returns true if a place is in the room, at least `margin` metres from the known walls.
    pub fn holds(&self, place: Place, margin: f64) -> bool {
        WallSide::ALL.into_iter().all(|side| self.wall(side).is_none_or(|wall| side.out(place) <= wall - margin))
    }

    /// Returns true if a wall is a mirror at a place along it. Right across, one's own head hides what is beyond, so
    /// the neighbouring pieces vote too.
    pub fn is_mirror(&self, side: WallSide, along: f64) -> bool {
        let votes = &self.votes[side as usize];
        let at = piece(along);
        let around = at.checked_sub(1).and_then(|first| votes.get(first..)?.get(..3));
        around.is_some_and(|around| around[1] >= 0 && around.iter().sum::<i32>() > 2)
    }

    /// The sides with at least half a metre of known mirror.
    pub fn mirrors(&self) -> impl Iterator<Item = WallSide> + '_ {
        let is_mirror =
            |side: &WallSide| self.votes[*side as usize].windows(2).any(|pair| pair.iter().all(|&votes| votes > 1));
        WallSide::ALL.into_iter().filter(is_mirror)
    }

    pub fn has_mirror(&self) -> bool {
        self.mirrors().next().is_some()
    }

    /// The apparent place of a body at `place` in a mirror on `side`.
    pub fn mirrored(&self, side: WallSide, place: Place) -> Option<Place> {
        Some(side.place(2.0 * self.wall(side)? - side.out(place), side.along(place)))
    }

    /// The first crossing of a wall between `from` and `to`.
    pub(crate) fn crossing(&self, from: Place, to: Place) -> Option<(WallSide, f64)> {
        let crossed = |side: WallSide| {
            let (start, end) = (side.out(from), side.out(to));
            let wall = self.wall(side).filter(|&wall| end > wall && end > start)?;
            let part = (wall - start) / (end - start);
            Some((part, side, side.along(from) + part * (side.along(to) - side.along(from))))
        };
        let nearest = WallSide::ALL.into_iter().filter_map(crossed).min_by(|one, other| one.0.total_cmp(&other.0))?;
        Some((nearest.1, nearest.2))
    }

    fn fixed(&self, side: WallSide, inside: Place) -> Option<f64> {
        let on_side = |look: &&Glance| look.side == Some(side) && look.foot.error < SHARP;
        let mut out: Vec<f64> = self.looks.iter().filter(on_side).map(|look| side.out(look.foot.place)).collect();
        out.retain(|&out| out > side.out(inside));
        out.sort_by(f64::total_cmp);
        let first = out.windows(ENOUGH).position(|run| run[ENOUGH - 1] - run[0] < LINE)?;
        let line = &out[first..];
        let end = line.partition_point(|&out| out < line[0] + 2.0 * LINE);
        Some(line[end / 2])
    }

    fn vote(&self, side: WallSide) -> Vec<i32> {
        let mut votes = vec![0; 2 * usize::try_from(PIECES).unwrap_or_default()];
        let Some(wall) = self.wall(side) else { return votes };
        for look in &self.looks {
            let beyond = side.out(look.foot.place) - wall;
            if beyond.abs() < LINE + look.foot.error {
                let at = piece(side.along(look.foot.place));
                votes.get_mut(at).into_iter().for_each(|vote| *vote -= 1);
            } else if beyond > BEYOND + 2.0 * look.foot.error
                && let Some((crossed, along)) = self.crossing(look.from, look.foot.place)
                && crossed == side
            {
                votes.get_mut(piece(along)).into_iter().for_each(|vote| *vote += 1);
            }
        }
        votes
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rooms are small, and what is beyond is no piece")]
fn piece(along: f64) -> usize {
    usize::try_from((along / PIECE).floor() as i32 + PIECES).unwrap_or(usize::MAX)
}

fn side_of(from: Place, before: Option<&Foot>, foot: &Foot, after: Option<&Foot>) -> Option<WallSide> {
    let (before, after) = (before?.place, after?.place);
    let (dx, dy) = ((after.x - before.x).abs(), (after.y - before.y).abs());
    let near = before.distance(after) < 1.5;
    if near && dx < 0.25 * dy {
        Some(if foot.place.x > from.x { WallSide::East } else { WallSide::West })
    } else if near && dy < 0.25 * dx {
        Some(if foot.place.y > from.y { WallSide::North } else { WallSide::South })
    } else {
        None
    }
}
