//! Ray intersections of spheres, capsules and boxes, and their bounding rectangles of pixels.
//!
//! Rule: a rectangle of pixels may be too large, never too small; a ray that starts inside a shape meets it from
//! inside, as MuJoCo's rays do.

use super::super::label_image::Rectangle;
use super::super::model::Stage;
use super::view::{RayView, Vector, dot, minus, plus};

#[derive(Clone, Copy, Debug)]
pub(super) enum RaySolid {
    /// A sphere if `half` is 0.
    Capsule { center: Vector, axis: Vector, half: f64, radius: f64 },
    /// Also a pane, whose face alone can be hit.
    Box { center: Vector, axes: [Vector; 3], halves: Vector },
}

pub(super) fn solid(stage: &Stage, geom: usize) -> RaySolid {
    use mujoco_rs::prelude::MjtGeomBase as Kind;
    let center = stage.data.geom_xpos()[geom];
    let rotation = stage.data.geom_xmat()[geom];
    let axes = [0, 1, 2].map(|column| [rotation[column], rotation[3 + column], rotation[6 + column]]);
    let size = stage.model.geom_size()[geom];
    match stage.model.geom_type()[geom] {
        Kind::mjGEOM_SPHERE => RaySolid::Capsule { center, axis: axes[2], half: 0.0, radius: size[0] },
        Kind::mjGEOM_CAPSULE => RaySolid::Capsule { center, axis: axes[2], half: size[1], radius: size[0] },
        _ => RaySolid::Box { center, axes, halves: size },
    }
}

impl RaySolid {
    /// The first intersection with a ray, in lengths of `ray` from `origin`.
    pub fn meets(&self, origin: Vector, ray: Vector) -> Option<f64> {
        match *self {
            Self::Capsule { center, axis, half, radius } => capsule(minus(origin, center), ray, axis, half, radius),
            Self::Box { center, axes, halves } => cuboid(minus(origin, center), ray, &axes, halves),
        }
    }

    /// Its bounding rectangle of pixels; `None` if it is out of view.
    pub fn rectangle(&self, view: &RayView) -> Option<Rectangle> {
        match *self {
            Self::Capsule { center, axis, half, radius } => {
                let ends = [half, -half].map(|along| (view.local(plus(center, along, axis)), radius));
                bounds(view, &ends)
            }
            Self::Box { center, axes, halves } => {
                let mut corners = [([0.0; 3], 0.0); 8];
                for (at, corner) in corners.iter_mut().enumerate() {
                    let sign = |bit: usize| if at >> bit & 1 == 0 { -1.0 } else { 1.0 };
                    let point = (0..3).fold(center, |sum, axis| plus(sum, sign(axis) * halves[axis], axes[axis]));
                    corner.0 = view.local(point);
                }
                bounds(view, &corners)
            }
        }
    }
}

/// A point of the view: to the right and up, both in halves of the view at one metre, and ahead.
type Local = [f64; 3];

impl RayView {
    fn local(&self, point: Vector) -> Local {
        let offset = minus(point, self.origin);
        [
            dot(offset, self.right) / dot(self.right, self.right),
            dot(offset, self.up) / dot(self.up, self.up),
            dot(offset, self.forward),
        ]
    }
}

/// The smallest rectangle of pixels that surely contains the hull of some spheres.
fn bounds(view: &RayView, spheres: &[(Local, f64)]) -> Option<Rectangle> {
    let halves = [dot(view.right, view.right), dot(view.up, view.up)].map(f64::sqrt);
    let [left, right] = span(spheres, 0, halves[0])?;
    let [bottom, top] = span(spheres, 1, halves[1])?;
    let [left, right] = pixels(left, right, view.width)?;
    let [top, bottom] = pixels(-top, -bottom, view.height)?;
    Some(Rectangle { left, right, top, bottom })
}

/// The minimum and maximum of a view coordinate on some spheres, from -1 to 1; `None` if all of them are outside on one
/// side.
fn span(spheres: &[(Local, f64)], axis: usize, half: f64) -> Option<[f64; 2]> {
    // A sphere is beyond a side of the view if its centre is further than its radius from that plane.
    let slope = (1.0 + half * half).sqrt();
    let beyond = |(local, radius): &(Local, f64), side: f64| half * (side * local[axis] - local[2]) > radius * slope;
    let is_out = |side: f64| spheres.iter().all(|sphere| beyond(sphere, side));
    if is_out(1.0) || is_out(-1.0) || spheres.iter().all(|(local, radius)| local[2] + radius <= 0.0) {
        return None;
    }
    let mut span = [f64::INFINITY, f64::NEG_INFINITY];
    for (local, radius) in spheres {
        if local[2] <= radius + 1e-6 {
            return Some([-1.0, 1.0]);
        }
        let [least, most] = tangents(local[axis] * half, local[2], *radius);
        span = [span[0].min(least / half), span[1].max(most / half)];
    }
    Some(span)
}

fn tangents(aside: f64, ahead: f64, radius: f64) -> [f64; 2] {
    let square = ahead * ahead - radius * radius;
    let root = radius * (aside * aside + square).max(0.0).sqrt();
    [(aside * ahead - root) / square, (aside * ahead + root) / square]
}

/// The pixels whose middles can be between two positions from -1 to 1.
fn pixels(from: f64, to: f64, count: usize) -> Option<[usize; 2]> {
    #[expect(clippy::cast_precision_loss, reason = "a number of pixels")]
    let size = count as f64;
    let place = |at: f64| f64::midpoint(at.clamp(-1.0, 1.0), 1.0) * size;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the view")]
    let [first, last] = [(place(from) - 0.51).max(0.0) as usize, (place(to) + 1.51) as usize];
    let last = last.min(count);
    (first < last).then_some([first, last])
}

fn capsule(offset: Vector, ray: Vector, axis: Vector, half: f64, radius: f64) -> Option<f64> {
    let [offset_along, ray_along] = [dot(offset, axis), dot(ray, axis)];
    let [offset_ray, ray_ray] = [dot(offset, ray), dot(ray, ray)];
    let offset_offset = dot(offset, offset) - radius * radius;
    // The infinite cylinder contains the capsule: a ray that misses it misses the capsule.
    let a = ray_ray - ray_along * ray_along;
    let b = offset_ray - ray_along * offset_along;
    let c = offset_offset - offset_along * offset_along;
    let square = b * b - a * c;
    if square < 0.0 {
        return None;
    }
    let mut nearest = f64::INFINITY;
    if half > 0.0 && a > 0.0 {
        let root = square.sqrt();
        for length in [(-b - root) / a, (-b + root) / a] {
            if length >= 0.0 && (offset_along + length * ray_along).abs() <= half {
                nearest = nearest.min(length);
            }
        }
    }
    for (end, side) in [(half, 1.0), (-half, -1.0)] {
        let b = offset_ray - end * ray_along;
        let c = offset_offset - 2.0 * end * offset_along + end * end;
        let square = b * b - ray_ray * c;
        if square < 0.0 {
            continue;
        }
        let root = square.sqrt();
        for length in [(-b - root) / ray_ray, (-b + root) / ray_ray] {
            if length >= 0.0 && (half <= 0.0 || side * (offset_along + length * ray_along) >= half) {
                nearest = nearest.min(length);
            }
        }
    }
    (nearest < f64::INFINITY).then_some(nearest)
}

fn cuboid(offset: Vector, ray: Vector, axes: &[Vector; 3], halves: Vector) -> Option<f64> {
    let (mut enters, mut leaves) = (f64::NEG_INFINITY, f64::INFINITY);
    for (axis, half) in axes.iter().zip(halves) {
        let [from, along] = [dot(offset, *axis), dot(ray, *axis)];
        if along.abs() < f64::MIN_POSITIVE {
            if from.abs() > half {
                return None;
            }
            continue;
        }
        let [one, other] = [(-half - from) / along, (half - from) / along];
        enters = enters.max(one.min(other));
        leaves = leaves.min(one.max(other));
    }
    if enters > leaves || leaves < 0.0 {
        return None;
    }
    Some(if enters >= 0.0 { enters } else { leaves })
}

#[cfg(test)]
mod tests {
    use super::{capsule, cuboid};

    const X: [f64; 3] = [1.0, 0.0, 0.0];
    const Z: [f64; 3] = [0.0, 0.0, 1.0];
    const AXES: [[f64; 3]; 3] = [X, [0.0, 1.0, 0.0], Z];

    #[track_caller]
    fn check(met: Option<f64>, expected: Option<f64>) {
        match (met, expected) {
            (Some(met), Some(expected)) => assert!((met - expected).abs() < 1e-12, "{met} is not {expected}"),
            _ => assert_eq!(met, expected),
        }
    }

    #[test]
    fn a_capsule_is_met_at_its_side_its_ends_and_from_inside() {
        check(capsule([-3.0, 0.0, 0.0], X, Z, 1.0, 0.5), Some(2.5));
        check(capsule([-3.0, 0.0, 1.3], X, Z, 1.0, 0.5), Some(2.6));
        check(capsule([-3.0, 0.0, 1.6], X, Z, 1.0, 0.5), None);
        check(capsule([0.0, 0.0, -9.0], Z, Z, 1.0, 0.5), Some(7.5));
        check(capsule([0.0, 0.0, 0.0], X, Z, 1.0, 0.5), Some(0.5));
        check(capsule([0.0, 0.0, 0.0], Z, Z, 1.0, 0.5), Some(1.5));
        check(capsule([3.0, 0.0, 0.0], X, Z, 1.0, 0.5), None);
        check(capsule([-3.0, 0.0, 0.3], X, Z, 0.0, 0.5), Some(2.6));
    }

    #[test]
    fn a_box_is_met_at_its_face_and_from_inside() {
        check(cuboid([-3.0, 0.0, 0.0], X, &AXES, [1.0, 2.0, 3.0]), Some(2.0));
        check(cuboid([-3.0, 2.1, 0.0], X, &AXES, [1.0, 2.0, 3.0]), None);
        check(cuboid([0.0, 0.0, 0.0], X, &AXES, [1.0, 2.0, 3.0]), Some(1.0));
        check(cuboid([3.0, 0.0, 0.0], X, &AXES, [1.0, 2.0, 3.0]), None);
        check(cuboid([0.0, 0.0, 5.0], [0.0, 0.0, -1.0], &AXES, [1.0, 1.0, 0.0]), Some(5.0));
    }
}
