//! The projection of pixels and points: an ideal pinhole, upright and level.
//!
//! Rule: only the protocol's vertical field of view and facts that a body knows of itself: the height of its eye, and
//! the eye's distance before its axis.

use super::real;
use crate::agent::Observation;
use crate::sim::angle::sine_cosine;

/// The eye above the floor, m.
pub const EYE_HEIGHT: f64 = 1.52;
/// The eye ahead of the body's axis, m.
const EYE_AHEAD: f64 = 0.14;

/// A place on the floor, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    pub x: f64,
    pub y: f64,
}

impl Place {
    pub fn distance(self, other: Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }

    /// `reach` metres from here in the direction of a heading.
    #[must_use]
    pub fn ahead(self, heading: Heading, reach: f64) -> Self {
        let (x, y) = heading.direction();
        Self { x: self.x + reach * x, y: self.y + reach * y }
    }
}

/// The direction of a body: twelfths of a turn, counter-clockwise from +x.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Heading(u8);

impl Heading {
    pub const COUNT: u8 = 12;
    pub const ALL: [Self; 12] =
        [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5), Self(6), Self(7), Self(8), Self(9), Self(10), Self(11)];

    /// The heading nearest to a yaw in degrees.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0..12 after rem_euclid")]
    pub fn nearest(yaw_degrees: f64) -> Self {
        Self((yaw_degrees / 30.0).round().rem_euclid(f64::from(Self::COUNT)) as u8)
    }

    /// Twelfths of a turn, 0..12.
    pub const fn twelfths(self) -> u8 {
        self.0
    }

    /// After a turn by 30 degrees, counter-clockwise.
    #[must_use]
    pub const fn left(self) -> Self {
        Self((self.0 + 1) % Self::COUNT)
    }

    /// After a turn by 30 degrees, clockwise.
    #[must_use]
    pub const fn right(self) -> Self {
        Self((self.0 + Self::COUNT - 1) % Self::COUNT)
    }

    /// Turns of 30 degrees to the left that lead to `goal`, -5..=6.
    pub fn turns_to(self, goal: Self) -> i32 {
        let turns = (i32::from(goal.0) - i32::from(self.0)).rem_euclid(12);
        if turns > 6 { turns - 12 } else { turns }
    }

    /// The unit vector; a table, so that it is the same on every machine.
    pub fn direction(self) -> (f64, f64) {
        const HALF_ROOT_3: f64 = 0.866_025_403_784_438_6;
        const COSINE: [f64; 12] =
            [1.0, HALF_ROOT_3, 0.5, 0.0, -0.5, -HALF_ROOT_3, -1.0, -HALF_ROOT_3, -0.5, 0.0, 0.5, HALF_ROOT_3];
        (COSINE[usize::from(self.0)], COSINE[usize::from((self.0 + 9) % 12)])
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub place: Place,
    pub heading: Heading,
}

impl Pose {
    pub fn of(observation: &Observation) -> Self {
        let place = Place { x: f64::from(observation.x), y: f64::from(observation.y) };
        Self { place, heading: Heading::nearest(f64::from(observation.yaw)) }
    }
}

/// A point as the eye sees it: metres ahead of the eye's plane and to the right of its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// Metres ahead; negative behind the eye.
    pub ahead: f64,
    pub right: f64,
}

#[derive(Clone, Copy, Debug)]
pub struct Camera {
    pub eye: Place,
    heading: Heading,
    half_width: f64,
    half_height: f64,
    focal: f64,
}

impl Camera {
    /// The camera of a body at `pose` whose pictures have `width` x `height` pixels and a vertical field of view of `fov_y`
    /// degrees, less than 180.
    pub fn new(pose: Pose, width: usize, height: usize, fov_y: f64) -> Self {
        let (half_width, half_height) = (real(width) / 2.0, real(height) / 2.0);
        let eye = pose.place.ahead(pose.heading, EYE_AHEAD);
        let (sine, cosine) = sine_cosine(fov_y / 2.0);
        Self { eye, heading: pose.heading, half_width, half_height, focal: half_height / (sine / cosine) }
    }

    /// The number of headings to either side of its own that are in the picture, 0 to 2.
    pub fn headings_aside(&self) -> i32 {
        let (next, second) = (Heading(1).direction(), Heading(2).direction());
        let shows = |(cosine, sine): (f64, f64)| self.focal * sine <= self.half_width * cosine;
        i32::from(shows(next)) + i32::from(shows(second))
    }

    /// The number of pixels per metre at a distance of `ahead` metres.
    pub fn scale(&self, ahead: f64) -> f64 {
        self.focal / ahead
    }

    pub fn bearing(&self, place: Place) -> Bearing {
        let (cosine, sine) = self.heading.direction();
        let (dx, dy) = (place.x - self.eye.x, place.y - self.eye.y);
        Bearing { ahead: dx * cosine + dy * sine, right: dx * sine - dy * cosine }
    }

    /// The column (not rounded) of a bearing; valid only ahead of the eye.
    pub fn column(&self, bearing: Bearing) -> f64 {
        self.half_width + self.focal * bearing.right / bearing.ahead
    }

    /// The row (not rounded) of a height above the floor, `ahead` metres away.
    pub fn row(&self, ahead: f64, height: f64) -> f64 {
        self.half_height + self.focal * (EYE_HEIGHT - height) / ahead
    }

    /// The distance of the floor in a row, m; `None` at and above the horizon.
    pub fn floor_ahead(&self, row: f64) -> Option<f64> {
        let below = row - self.half_height;
        (below > 0.5).then(|| self.focal * EYE_HEIGHT / below)
    }

    /// The height above the floor of a row's content, `ahead` metres away.
    pub fn height(&self, ahead: f64, row: f64) -> f64 {
        EYE_HEIGHT - (row - self.half_height) * ahead / self.focal
    }

    /// The place in a column, `ahead` metres away.
    pub fn place(&self, column: f64, ahead: f64) -> Place {
        let right = (column - self.half_width) * ahead / self.focal;
        let (cosine, sine) = self.heading.direction();
        Place { x: self.eye.x + ahead * cosine + right * sine, y: self.eye.y + ahead * sine - right * cosine }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(twelfths: u8) -> Camera {
        camera_of(twelfths, 110.0)
    }

    fn camera_of(twelfths: u8, fov_y: f64) -> Camera {
        Camera::new(Pose { place: Place { x: 1.0, y: -2.0 }, heading: Heading(twelfths) }, 640, 480, fov_y)
    }

    #[test]
    fn a_narrow_view_shows_less_and_larger() {
        let tall = |fov_y: f64| camera_of(0, fov_y).row(4.0, 0.0) - 240.0;
        assert!((tall(60.0) / tall(110.0) - 2.473_624).abs() < 1e-5, "{}", tall(60.0) / tall(110.0));
        assert_eq!([30.0, 60.0, 90.0, 110.0].map(|fov_y| camera_of(0, fov_y).headings_aside()), [0, 1, 1, 2]);
    }

    #[test]
    fn projection_and_bearing_are_inverse() {
        for heading in Heading::ALL {
            let camera = camera(heading.twelfths());
            for (column, ahead) in [(0.5, 0.7), (320.0, 3.0), (600.25, 8.0)] {
                let bearing = camera.bearing(camera.place(column, ahead));
                assert!((bearing.ahead - ahead).abs() < 1e-9);
                assert!((camera.column(bearing) - column).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn the_floor_and_the_horizon_are_where_the_eye_height_says() {
        let camera = camera(0);
        assert_eq!(camera.floor_ahead(240.0), None);
        let ahead = camera.floor_ahead(480.0).unwrap();
        assert!((ahead - EYE_HEIGHT / 55.0_f64.to_radians().tan()).abs() < 1e-9);
        assert!(camera.height(ahead, 480.0).abs() < 1e-9);
        assert!((camera.row(5.0, EYE_HEIGHT) - 240.0).abs() < 1e-9);
    }

    #[test]
    fn things_to_the_left_of_the_heading_are_drawn_on_the_left() {
        let ahead_and_left = Place { x: 4.0, y: 0.0 };
        assert!(camera(0).column(camera(0).bearing(ahead_and_left)) < 320.0);
    }

    #[test]
    fn turns_take_the_shorter_way() {
        assert_eq!(Heading(11).turns_to(Heading(1)), 2);
        assert_eq!(Heading(1).turns_to(Heading(11)), -2);
        assert_eq!(Heading(0).turns_to(Heading(6)), 6);
        assert_eq!(Heading::nearest(-30.0), Heading(11));
        assert_eq!(Heading::nearest(359.9), Heading(0));
        assert_eq!(Heading(0).left().right(), Heading(0));
    }
}
