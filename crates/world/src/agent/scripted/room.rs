//! The room as far as it has been seen: four walls, and where one of them is a mirror.
//!
//! A wall is the nearest straight line on its side on which enough feet of walls were seen. Feet that seem to lie beyond a
//! wall were seen through it: where the look crossed it, it is a mirror.
//!
//! Rule: walls are parallel to the axes of the room. Everything follows from the feet seen so far, whatever their order.

use crate::agent::perception::View;
use crate::agent::perception::camera::{Heading, Place};
use crate::agent::perception::ground::Foot;

/// One of the four walls, by the direction in which it lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    /// Towards +x.
    East,
    /// Towards +y.
    North,
    /// Towards -x.
    West,
    /// Towards -y.
    South,
}

impl Side {
    /// All four.
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

    /// Facing this wall at a right angle.
    pub const fn heading(self) -> Heading {
        Heading::ALL[3 * self as usize]
    }
}

/// A wall's foot and from where it was seen.
#[derive(Clone, Copy, Debug)]
struct Look {
    from: Place,
    foot: Foot,
    side: Option<Side>,
}

/// Width of a piece of wall about which the looks vote, m.
const PIECE: f64 = 0.25;
/// Pieces from the middle of a wall to either end: rooms up to 16 m wide.
const PIECES: i32 = 32;
/// A foot that one row would move by more than this does not fix a wall, m.
const SHARP: f64 = 0.16;
/// Looks that fix a wall.
const ENOUGH: usize = 10;
/// The drawn width of a wall's line, m.
const LINE: f64 = 0.12;
/// The least distance beyond a wall of a foot that was seen through it, m.
const BEYOND: f64 = 0.5;

/// The seen parts of the walls.
#[derive(Clone, Debug, Default)]
pub struct Room {
    looks: Vec<Look>,
    walls: [Option<f64>; 4],
    votes: [Vec<i32>; 4],
}

impl Room {
    /// Takes in the feet of walls in a view.
    pub fn see(&mut self, view: &View) {
        let from = view.camera.eye();
        let side = |at: usize| {
            side_of(view.pose.place, view.feet.get(at.wrapping_sub(1)), &view.feet[at], view.feet.get(at + 1))
        };
        self.looks.extend((0..view.feet.len()).map(|at| Look { from, foot: view.feet[at], side: side(at) }));
        self.walls = Side::ALL.map(|side| self.fixed(side, view.pose.place));
        self.votes = Side::ALL.map(|side| self.vote(side));
    }

    /// The distance of a wall, m; `None` until it has been seen.
    pub const fn wall(&self, side: Side) -> Option<f64> {
        self.walls[side as usize]
    }

    /// Returns true if a place is in the room, `margin` metres from the walls that are known.
    pub fn holds(&self, place: Place, margin: f64) -> bool {
        Side::ALL.into_iter().all(|side| self.wall(side).is_none_or(|wall| side.out(place) <= wall - margin))
    }

    /// Whether a wall is a mirror at a place along it. Right across from oneself one's own head hides what lies beyond, so the
    /// pieces to either side have a say.
    pub fn is_mirror(&self, side: Side, along: f64) -> bool {
        let votes = &self.votes[side as usize];
        let at = piece(along);
        let around = at.checked_sub(1).and_then(|first| votes.get(first..)?.get(..3));
        around.is_some_and(|around| around[1] >= 0 && around.iter().sum::<i32>() > 2)
    }

    /// The sides whose wall is a mirror, as far as seen, for at least half a metre.
    pub fn mirrors(&self) -> impl Iterator<Item = Side> + '_ {
        let is_mirror =
            |side: &Side| self.votes[*side as usize].windows(2).any(|pair| pair.iter().all(|&votes| votes > 1));
        Side::ALL.into_iter().filter(is_mirror)
    }

    /// Returns true if any wall is one.
    pub fn has_mirror(&self) -> bool {
        self.mirrors().next().is_some()
    }

    /// The apparent place of a body at `place` by way of a mirror on `side`.
    pub fn mirrored(&self, side: Side, place: Place) -> Option<Place> {
        Some(side.place(2.0 * self.wall(side)? - side.out(place), side.along(place)))
    }

    /// The first crossing of a wall between `from` and `to`.
    pub fn crossing(&self, from: Place, to: Place) -> Option<(Side, f64)> {
        let crossed = |side: Side| {
            let (start, end) = (side.out(from), side.out(to));
            let wall = self.wall(side).filter(|&wall| end > wall && end > start)?;
            let part = (wall - start) / (end - start);
            Some((part, side, side.along(from) + part * (side.along(to) - side.along(from))))
        };
        let nearest = Side::ALL.into_iter().filter_map(crossed).min_by(|one, other| one.0.total_cmp(&other.0))?;
        Some((nearest.1, nearest.2))
    }

    fn fixed(&self, side: Side, inside: Place) -> Option<f64> {
        let on_side = |look: &&Look| look.side == Some(side) && look.foot.error < SHARP;
        let mut out: Vec<f64> = self.looks.iter().filter(on_side).map(|look| side.out(look.foot.place)).collect();
        out.retain(|&out| out > side.out(inside));
        out.sort_by(f64::total_cmp);
        let first = out.windows(ENOUGH).position(|run| run[ENOUGH - 1] - run[0] < LINE)?;
        let line = &out[first..];
        let end = line.partition_point(|&out| out < line[0] + 2.0 * LINE);
        Some(line[end / 2])
    }

    fn vote(&self, side: Side) -> Vec<i32> {
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

fn side_of(from: Place, before: Option<&Foot>, foot: &Foot, after: Option<&Foot>) -> Option<Side> {
    let (before, after) = (before?.place, after?.place);
    let (dx, dy) = ((after.x - before.x).abs(), (after.y - before.y).abs());
    let near = before.distance(after) < 1.5;
    let wall = if near && dx < 0.25 * dy {
        if foot.place.x > from.x { Side::East } else { Side::West }
    } else if near && dy < 0.25 * dx {
        if foot.place.y > from.y { Side::North } else { Side::South }
    } else {
        return None;
    };
    Some(wall)
}
