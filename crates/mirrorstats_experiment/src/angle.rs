//! Headings, sines and rotations that are bit-identical on every machine.
//!
//! Rule: only multiplication, addition and square roots, which IEEE 754 defines exactly; no `sin` of a C library.

use serde::{Deserialize, Serialize};

/// The direction of an upright body: multiples of 30 degrees counter-clockwise from +x, 0 to 11.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(transparent)]
pub struct Heading(#[schemars(range(max = 11))] u8);

/// Headings in a full turn.
pub const HEADINGS: u8 = 12;

/// sin of 0, 15, 30, 45, 60, 75 and 90 degrees.
const SINES: [f64; 7] = [
    0.0,
    0.258_819_045_102_520_76,
    0.5,
    std::f64::consts::FRAC_1_SQRT_2,
    0.866_025_403_784_438_6,
    0.965_925_826_289_068_3,
    1.0,
];

/// sin of a multiple of 15 degrees, from the table.
fn sine_of_fifteens(fifteens: usize) -> f64 {
    match fifteens % 24 {
        at @ 0..=6 => SINES[at],
        at @ 7..=12 => SINES[12 - at],
        at @ 13..=18 => -SINES[at - 12],
        at => -SINES[24 - at],
    }
}

impl Heading {
    pub const fn new(thirties: u8) -> Self {
        Self(thirties % HEADINGS)
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0..12 after rem_euclid")]
    pub fn nearest(yaw: f64) -> Self {
        Self((yaw / 30.0).round().rem_euclid(f64::from(HEADINGS)) as u8)
    }

    /// Steps of 30 degrees from +x, 0 to 11.
    pub const fn thirties(self) -> u8 {
        self.0
    }

    pub fn degrees(self) -> f64 {
        30.0 * f64::from(self.0)
    }

    /// The heading after `thirties` steps to the left; negative to the right.
    #[must_use]
    pub fn turned(self, thirties: i8) -> Self {
        let turned = (i16::from(self.0) + i16::from(thirties)).rem_euclid(i16::from(HEADINGS));
        Self(u8::try_from(turned).expect("a remainder of 12 is less than 12"))
    }

    /// Steps to the left that lead to `goal`, -5..=6.
    pub fn turns_to(self, goal: Self) -> i32 {
        let turns = (i32::from(goal.0) - i32::from(self.0)).rem_euclid(12);
        if turns > 6 { turns - 12 } else { turns }
    }

    pub fn direction(self) -> [f64; 2] {
        let fifteens = 2 * usize::from(self.0);
        [sine_of_fifteens(fifteens + 6), sine_of_fifteens(fifteens)]
    }

    /// The rotation about the vertical from +x to this heading.
    pub fn rotation(self) -> Quaternion {
        let half = usize::from(self.0);
        Quaternion([sine_of_fifteens(half + 6), 0.0, 0.0, sine_of_fifteens(half)])
    }
}

/// sin and cos of an angle between -90 and 90 degrees, by series.
pub fn sine_cosine(degrees: f64) -> (f64, f64) {
    let x = degrees * (std::f64::consts::PI / 180.0);
    let (mut sine, mut cosine) = (0.0, 0.0);
    let mut term = 1.0;
    for at in 0..30_u32 {
        match at % 4 {
            0 => cosine += term,
            1 => sine += term,
            2 => cosine -= term,
            _ => sine -= term,
        }
        term *= x / f64::from(at + 1);
    }
    (sine, cosine)
}

/// A rotation as a unit quaternion (w, x, y, z), in MuJoCo's order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion(pub [f64; 4]);

impl Quaternion {
    /// The rotation about +y by an angle between -90 and 90 degrees: a hanging limb swings back if positive.
    pub fn about_y(degrees: f64) -> Self {
        let (sine, cosine) = sine_cosine(degrees / 2.0);
        Self([cosine, 0.0, sine, 0.0])
    }

    /// This rotation after `first`.
    #[must_use]
    pub fn after(self, first: Self) -> Self {
        let (p, q) = (self.0, first.0);
        Self([
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::{HEADINGS, Heading, Quaternion, sine_cosine};

    #[test]
    fn headings_agree_with_the_library() {
        for thirties in 0..HEADINGS {
            let [x, y] = Heading::new(thirties).direction();
            let (sine, cosine) = (f64::from(thirties) * 30.0).to_radians().sin_cos();
            assert!((x - cosine).abs() < 1e-15 && (y - sine).abs() < 1e-15, "{thirties}: {x} {y}");
        }
    }

    #[test]
    fn headings_wrap_around() {
        assert_eq!(Heading::new(0).turned(-1), Heading::new(11));
        assert_eq!(Heading::new(11).turned(1), Heading::new(0));
        assert_eq!(Heading::new(14), Heading::new(2));
    }

    #[test]
    fn the_series_is_the_sine() {
        for degrees in -90..=90 {
            let (sine, cosine) = sine_cosine(f64::from(degrees));
            let (expected_sine, expected_cosine) = f64::from(degrees).to_radians().sin_cos();
            assert!((sine - expected_sine).abs() < 4e-16 && (cosine - expected_cosine).abs() < 4e-16, "{degrees}");
        }
    }

    #[test]
    fn twelve_turns_return_to_the_start() {
        let step = Heading::new(1).rotation();
        let turned = (0..24).fold(Quaternion([1.0, 0.0, 0.0, 0.0]), |sum, _| step.after(sum));
        assert!((turned.0[0] - 1.0).abs() < 1e-12, "{turned:?}");
    }

    #[test]
    fn turns_take_the_shorter_way() {
        assert_eq!(Heading(11).turns_to(Heading(1)), 2);
        assert_eq!(Heading(1).turns_to(Heading(11)), -2);
        assert_eq!(Heading(0).turns_to(Heading(6)), 6);
        assert_eq!(Heading::nearest(-30.0), Heading(11));
        assert_eq!(Heading::nearest(359.9), Heading(0));
    }
}
