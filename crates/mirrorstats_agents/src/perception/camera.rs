//! The projection of pixels and points: an ideal pinhole, upright and level.
//!
//! Rule: only the protocol's vertical field of view and facts that a body knows of itself: the height of its eye, and
//! the eye's distance before its axis.

use super::real;
use crate::Observation;
pub use mirrorstats_experiment::angle::Heading;
use mirrorstats_experiment::angle::sine_cosine;

/// The eye above the floor, m.
pub(crate) const EYE_HEIGHT: f64 = 1.52;
/// The eye ahead of the body's axis, m.
const EYE_AHEAD: f64 = 0.14;

/// A place on the floor, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
        let [x, y] = heading.direction();
        Self { x: self.x + reach * x, y: self.y + reach * y }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Viewpoint {
    pub place: Place,
    pub heading: Heading,
}

impl Viewpoint {
    pub fn from_observation(observation: &Observation) -> Self {
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
pub struct ViewCamera {
    pub eye: Place,
    heading: Heading,
    half_width: f64,
    half_height: f64,
    focal: f64,
}

impl ViewCamera {
    /// The camera of a body at `pose` whose pictures have `width` x `height` pixels and a vertical field of view of `fov_y`
    /// degrees, less than 180.
    pub fn new(pose: Viewpoint, width: usize, height: usize, fov_y: f64) -> Self {
        let (half_width, half_height) = (real(width) / 2.0, real(height) / 2.0);
        let eye = pose.place.ahead(pose.heading, EYE_AHEAD);
        let (sine, cosine) = sine_cosine(fov_y / 2.0);
        Self { eye, heading: pose.heading, half_width, half_height, focal: half_height / (sine / cosine) }
    }

    /// The number of headings to either side of its own that are in the picture, 0 to 2.
    pub(crate) fn headings_aside(&self) -> i32 {
        let shows = |turns: u8| {
            let [cosine, sine] = Heading::new(turns).direction();
            self.focal * sine <= self.half_width * cosine
        };
        i32::from(shows(1)) + i32::from(shows(2))
    }

    pub fn scale(&self, ahead: f64) -> f64 {
        self.focal / ahead
    }

    pub(crate) fn bearing(&self, place: Place) -> Bearing {
        let [cosine, sine] = self.heading.direction();
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
    pub(crate) fn floor_ahead(&self, row: f64) -> Option<f64> {
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
        let [cosine, sine] = self.heading.direction();
        Place { x: self.eye.x + ahead * cosine + right * sine, y: self.eye.y + ahead * sine - right * cosine }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(thirties: u8) -> ViewCamera {
        camera_of(thirties, 110.0)
    }

    fn camera_of(thirties: u8, fov_y: f64) -> ViewCamera {
        ViewCamera::new(
            Viewpoint { place: Place { x: 1.0, y: -2.0 }, heading: Heading::new(thirties) },
            640,
            480,
            fov_y,
        )
    }

    #[test]
    fn a_narrow_view_shows_less_and_larger() {
        let tall = |fov_y: f64| camera_of(0, fov_y).row(4.0, 0.0) - 240.0;
        assert!((tall(60.0) / tall(110.0) - 2.473_624).abs() < 1e-5, "{}", tall(60.0) / tall(110.0));
        assert_eq!([30.0, 60.0, 90.0, 110.0].map(|fov_y| camera_of(0, fov_y).headings_aside()), [0, 1, 1, 2]);
    }

    #[test]
    fn projection_and_bearing_are_inverse() {
        for thirties in 0..12 {
            let camera = camera(thirties);
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
}
