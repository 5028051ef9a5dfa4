//! The edges between walls and floor, and the columns that show a floor behind a wall.
//!
//! At the height of the eye a column shows a wall, or something that stands before it. A wall is flat and evenly lit: it
//! has one shade, down to the floor. So the first change of shade below the horizon is the wall's foot, and its row says
//! how far away it is. Through a mirror the same holds for the wall that is reflected, whose foot then lies beyond the
//! room: that is how a mirror without a frame shows.
//!
//! Rule: a column that shows paint at or above the foot says nothing.

use trace::frame::Frame;

use super::camera::{Camera, Place};
use super::paint;

/// The tolerance of a channel within one shade. The light is even, and a floor may be nearly as grey as a wall.
const SAME_SHADE: i16 = 1;
/// Columns from one foot to the next that is looked for.
const STRIDE: usize = 4;

/// The foot of the wall that one column shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Its apparent place: beyond the room if it was seen by way of a mirror.
    pub place: Place,
    /// The change of its place by one row, m.
    pub error: f64,
}

/// The feet of the walls in a picture, from left to right.
pub fn feet(frame: &Frame, camera: &Camera) -> Vec<Foot> {
    (STRIDE / 2..frame.width).step_by(STRIDE).filter_map(|column| foot(frame, camera, column)).collect()
}

#[expect(clippy::cast_precision_loss, reason = "pixels of a picture are few")]
fn foot(frame: &Frame, camera: &Camera, column: usize) -> Option<Foot> {
    let horizon = frame.height / 2;
    let shade = pixel(frame, column, horizon);
    let is_wall = |row: &usize| same_shade(pixel(frame, column, *row), shade);
    paint::color(shade).is_none().then_some(())?;
    let row = (horizon + 1..frame.height).find(|row| !is_wall(row))?;
    // The row of the change is a mixture of both; the one below it is not.
    let below = pixel(frame, column, (row + 2).min(frame.height - 1));
    let rows_of_wall_above = (1..=row - horizon).take_while(|up| is_wall(&(horizon - up))).count();
    // A wall goes on above the horizon for as far as its foot is below, at least in part; a face does not.
    if paint::color(below).is_some()
        || paint::color(pixel(frame, column, row)).is_some()
        || rows_of_wall_above * 3 < row - horizon
    {
        return None;
    }
    let edge = row as f64;
    let ahead = camera.floor_ahead(edge)?;
    let nearer = camera.floor_ahead(edge + 1.0)?;
    Some(Foot { place: camera.place(column as f64 + 0.5, ahead), error: ahead - nearer })
}

fn pixel(frame: &Frame, column: usize, row: usize) -> &[u8] {
    let at = 3 * (row * frame.width + column);
    &frame.rgb[at..at + 3]
}

fn same_shade(one: &[u8], other: &[u8]) -> bool {
    one.iter().zip(other).all(|(&a, &b)| (i16::from(a) - i16::from(b)).abs() <= SAME_SHADE)
}
