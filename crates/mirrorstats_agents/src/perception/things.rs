//! Cubes and bodies, distinguished by shape.
//!
//! Both stand on the floor, so a patch's lowest row gives its distance and its highest row then its height. A cube is
//! as wide as it is tall. A body reaches nearly to the height of the looking eye, at any distance.
//!
//! Rule: a cube counts only if it is completely in view; a cropped or half-hidden one does not. The place of a thing
//! seen in a mirror is the apparent place of its reflection.

use mirrorstats_trace::schema::colors::Color;

use super::camera::{EYE_HEIGHT, Place, ViewCamera};
use super::patches::ColorPatch;
use super::real;

/// A thing of one colour that stands on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thing {
    pub color: Color,
    pub place: Place,
    pub pixels: usize,
    pub column: f64,
}

/// The minimum number of pixels of a cube.
const LEAST_OF_CUBE: usize = 40;
/// The minimum number of pixels of a body.
const LEAST_OF_BODY: usize = 30;
/// The minimum and maximum edge of a cube, m.
const EDGES: (f64, f64) = (0.28, 0.95);
/// The range of a cube's width relative to its edge: seen at 45 degrees or from the side it is wider than its edge.
const WIDTHS: (f64, f64) = (0.75, 2.0);
/// The minimum share of a cube's bounding box that the cube fills.
const FULLNESS: f64 = 0.6;
/// The maximum distance of a body's top below the horizon, relative to the distance to its feet.
const HIGH: f64 = 0.33;
/// Half of the depth of a body, m.
const HALF_BODY: f64 = 0.12;

pub fn cubes(patches: &[ColorPatch], camera: &ViewCamera, width: usize, height: usize) -> Vec<Thing> {
    patches.iter().filter(|patch| is_whole(patch, width, height)).filter_map(|patch| cube(patch, camera)).collect()
}

const fn is_whole(patch: &ColorPatch, width: usize, height: usize) -> bool {
    patch.left > 0 && patch.right + 1 < width && patch.bottom + 1 < height
}

fn cube(patch: &ColorPatch, camera: &ViewCamera) -> Option<Thing> {
    let ahead = camera.floor_ahead(real(patch.bottom) + 1.0)?;
    // The highest row shows the rear edge of the top: `edge` above the floor, and `edge` farther away than the front.
    let fall = (EYE_HEIGHT - camera.height(ahead, real(patch.top))) / ahead;
    let edge = (EYE_HEIGHT - fall * ahead) / (1.0 + fall);
    let width = real(patch.width()) / camera.scale(ahead);
    let is_cube = patch.pixels >= LEAST_OF_CUBE
        && real(patch.pixels) >= FULLNESS * real(patch.width() * patch.height())
        && (EDGES.0..=EDGES.1).contains(&edge)
        && (WIDTHS.0 * edge..=WIDTHS.1 * edge).contains(&width);
    is_cube.then(|| thing(patch, camera, ahead + 0.55 * edge))
}

/// The bodies of a picture of `width` x `height` pixels: no cubes, with limbs and trunk joined if their columns touch.
pub fn bodies(patches: &[ColorPatch], camera: &ViewCamera, width: usize, height: usize) -> Vec<Thing> {
    let mut wholes: Vec<ColorPatch> = Vec::new();
    for patch in patches.iter().filter(|patch| !is_whole(patch, width, height) || cube(patch, camera).is_none()) {
        let mut whole = *patch;
        // Joining widens a body, so that it may touch others.
        while let Some(at) = wholes.iter().position(|other| of_one_body(other, &whole)) {
            whole = wholes.swap_remove(at).joined(&whole);
        }
        wholes.push(whole);
    }
    wholes.iter().filter_map(|patch| body(patch, camera, height)).collect()
}

fn of_one_body(one: &ColorPatch, other: &ColorPatch) -> bool {
    let slack = 2 + one.width().min(other.width()) / 2;
    one.color == other.color && one.left <= other.right + slack && other.left <= one.right + slack
}

fn body(patch: &ColorPatch, camera: &ViewCamera, height: usize) -> Option<Thing> {
    let horizon = real(height) / 2.0;
    let (top, bottom) = (real(patch.top) - horizon, real(patch.bottom) + 1.0 - horizon);
    let is_body =
        patch.pixels >= LEAST_OF_BODY && bottom > 0.0 && top < HIGH * bottom && patch.height() > patch.width();
    let ahead = camera.floor_ahead(horizon + bottom)? + HALF_BODY;
    is_body.then(|| thing(patch, camera, ahead))
}

fn thing(patch: &ColorPatch, camera: &ViewCamera, ahead: f64) -> Thing {
    let column = patch.middle();
    Thing { color: patch.color, place: camera.place(column, ahead), pixels: patch.pixels, column }
}
