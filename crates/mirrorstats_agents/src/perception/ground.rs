//! The edges between walls and floor, and the columns with a floor behind a wall.
//!
//! At the height of the eye a column shows a wall or something before it. A wall is flat and evenly lit: it has one
//! shade, down to the floor. So the first change of shade below the horizon is the wall's foot, and its row gives the
//! distance. The same holds for a wall seen in a mirror, whose foot appears beyond the room: this reveals frameless
//! mirrors.
//!
//! Rule: a column with paint at or above the foot is ignored.

use mirrorstats_trace::frame::Frame;

use super::camera::{Place, ViewCamera};
use super::{paint, real};

/// The tolerance of a channel within one shade. The light is even, and a floor may be nearly as grey as a wall.
const SAME_SHADE: i16 = 1;
/// Columns between two examined feet.
const STRIDE: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Its apparent place: beyond the room if seen in a mirror.
    pub place: Place,
    /// The change of its place by one row, m.
    pub error: f64,
}

pub fn feet(frame: &Frame, camera: &ViewCamera) -> Vec<Foot> {
    (STRIDE / 2..frame.width).step_by(STRIDE).filter_map(|column| foot(frame, camera, column)).collect()
}

fn foot(frame: &Frame, camera: &ViewCamera, column: usize) -> Option<Foot> {
    let horizon = frame.height / 2;
    let shade = pixel(frame, column, horizon);
    let is_wall = |row: &usize| same_shade(pixel(frame, column, *row), shade);
    paint::color(shade).is_none().then_some(())?;
    let row = (horizon + 1..frame.height).find(|row| !is_wall(row))?;
    // The row of the change is a mixture of both; the row below is not.
    let below = pixel(frame, column, (row + 2).min(frame.height - 1));
    let rows_of_wall_above = (1..=row - horizon).take_while(|up| is_wall(&(horizon - up))).count();
    // A wall continues above the horizon for at least part of the height below it; a face does not.
    if paint::color(below).is_some()
        || paint::color(pixel(frame, column, row)).is_some()
        || rows_of_wall_above * 3 < row - horizon
    {
        return None;
    }
    let edge = real(row);
    let ahead = camera.floor_ahead(edge)?;
    let nearer = camera.floor_ahead(edge + 1.0)?;
    Some(Foot { place: camera.place(real(column) + 0.5, ahead), error: ahead - nearer })
}

fn pixel(frame: &Frame, column: usize, row: usize) -> &[u8] {
    let at = 3 * (row * frame.width + column);
    &frame.rgb[at..at + 3]
}

fn same_shade(one: &[u8], other: &[u8]) -> bool {
    one.iter().zip(other).all(|(&a, &b)| (i16::from(a) - i16::from(b)).abs() <= SAME_SHADE)
}
